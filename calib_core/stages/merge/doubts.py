"""What makes a merge doubtful: scans that are of no use, lie apart, or overlap nothing; a doubtful outside."""

from collections.abc import Sequence

import numpy as np

from calib_core.findings.codes import merge as codes
from calib_core.fusion.solve import Looked, MergeSolution
from calib_core.messages import message
from calib_core.records import Changes, Finding, RootCause

_SUSPICIOUS = 1.5  # overlap over what is expected: something beyond the calibration moves the scans
_FAR_OFF = 3.0  # a scan's own RMS over what is expected of it: chance alone hardly does that
_MOST_NAMED = 8


def merge_doubts(solution: MergeSolution, mistakes: Sequence[Finding]) -> list[Finding]:
    """Return every reason for doubt beside the mistakes that were found."""
    found = [
        codes.SCAN_OF_NO_USE([name], why=message("need {need}, got {got}", need=error.need, got=error.got))
        for name, error in solution.failed.items()
        if not any(name in one.captures for one in mistakes)
    ]
    if any(one.severity == "error" for one in mistakes):
        return found  # all else follows from these
    return [*found, *_about_overlap(solution.looked), *_about_outside(solution.looked)]


def _about_overlap(looked: Looked) -> list[Finding]:
    apart, found = looked.overlap, list[Finding]()
    pairs = apart.per_scan[:, 0]
    alone = [name for name, count in zip(looked.used, pairs, strict=True) if count == 0]
    if not apart.pairs and len(looked.used) > 1:
        found.append(codes.NO_OVERLAP())
    elif apart.pairs and alone:
        found.append(codes.SCANS_ALONE(alone))
    off = _far_off(looked)
    if apart.pairs and apart.rms_mm > _SUSPICIOUS * apart.expected_rms_mm and not off:
        worst = int(np.nanargmax(apart.per_scan[:, 2]))
        found.append(
            codes.SCANS_APART(
                [looked.used[worst]],
                rms_mm=apart.rms_mm,
                expected_mm=apart.expected_rms_mm,
                worst=looked.used[worst],
                worst_mm=float(apart.per_scan[worst, 2]),
            )
        )
    if off:
        named = [
            f"{looked.used[k]} ({apart.per_scan[k, 2]:.3f} mm; {apart.per_scan[k, 3]:.3f} mm)"
            for k in off[:_MOST_NAMED]
        ]
        found.append(codes.SCANS_FAR_OFF([looked.used[k] for k in off], named=named))
    return found


def _far_off(looked: Looked) -> list[int]:
    """Return scans that lie much farther off the others than is expected, the farthest first; none if most do."""
    _, _, rms, expected = looked.overlap.per_scan.T
    off = [k for k in range(len(looked.used)) if rms[k] > _FAR_OFF * expected[k]]
    return sorted(off, key=lambda k: -rms[k]) if len(off) <= len(looked.used) / 2 else []


def _about_outside(looked: Looked) -> list[Finding]:
    """Return what is doubtful of the side that was taken to be the outside."""
    out = looked.outward
    if out.contradicts and out.how == "told":
        remedy = RootCause(
            id="z-axis",
            kind="scanner-axis",
            title="",
            sentence="",
            changes=Changes(cell={"scanner": {"z_axis": None}}),
        )
        return [codes.SURFACE_INSIDE_OUT(remedy=remedy)]
    if out.certain:
        return []
    return [codes.OUTSIDE_DOUBTFUL(how=out.how)]
