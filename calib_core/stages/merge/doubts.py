"""What makes a merge doubtful: scans that are of no use, lie apart, or overlap nothing; the likely mistake."""

from collections.abc import Sequence

import numpy as np

from calib_core.captures.scans import Placement, ScanGroup
from calib_core.evidence.words import not_used
from calib_core.fusion.overlap import overlap
from calib_core.fusion.solve import MergeSolution

_SUSPICIOUS = 1.5  # overlap over what is expected: something beyond the calibration moves the scans
_MORE_PAIRS = 2.0
_FAR_OFF = 3.0  # a scan's own RMS over what is expected of it: chance alone hardly does that
_LEAST_SIZES = 2.0  # of a patch: nobody scans so little of an object with voxels as large
_LARGE_PATCH_MM = 10.0
_MOST_NAMED = 8


def merge_doubts(groups: Sequence[ScanGroup], placement: Placement, solution: MergeSolution) -> list[str]:
    """Return every reason for doubt as a sentence, what explains the others first.

    Parameters
    ----------
    groups : sequence of ScanGroup
        All scans that were to be merged.
    placement : Placement
    solution : MergeSolution
    """
    apart = solution.overlap
    doubts = not_used({name: error.reason for name, error in solution.failed.items()})
    tiny = _about_size(solution)
    doubts += tiny
    pairs = apart.per_scan[:, 0]
    alone = [name for name, count in zip(solution.used, pairs, strict=True) if count == 0]
    far = apart.pairs > 0 and apart.rms_mm > _SUSPICIOUS * apart.expected_rms_mm
    few = len(solution.used) > 1 and apart.pairs < len(solution.patches.scans)
    if (far or few) and not tiny:
        angles = _about_angles(groups, placement, solution)
        if angles:
            return [*doubts, *angles]  # all else follows from these
    if not apart.pairs and len(solution.used) > 1:
        doubts.append(
            "No two scans overlap, so nothing says how well they fit together: scan some of the surface twice."
        )
    elif apart.pairs and alone:
        names = ", ".join(alone[:_MOST_NAMED]) + (" and more" if len(alone) > _MOST_NAMED else "")
        doubts.append(
            f"Nothing says how well these fit: {names} overlap no other scan. Check pose and table angle, or scan "
            "some of their surface again."
        )
    off = _far_off(solution)
    single = bool(off) and len(off) <= len(solution.used) / 2
    if far and not single:
        worst = int(np.nanargmax(apart.per_scan[:, 2]))
        doubts.append(
            f"Scans lie {apart.rms_mm:.3f} mm apart where {apart.expected_rms_mm:.3f} mm is expected, "
            f"{solution.used[worst]} the farthest ({apart.per_scan[worst, 2]:.3f} mm): "
            "check its pose and table angle, and that the object did not move."
        )
    if single:
        names = ", ".join(off[:_MOST_NAMED]) + (" and more" if len(off) > _MOST_NAMED else "")
        doubts.append(
            f"Far off where they overlap the others: {names}. Check their poses and table angles, which may be "
            "those of another scan, and that the object did not move."
        )
    return [*doubts, *_about_outside(solution)]


def _about_outside(solution: MergeSolution) -> list[str]:
    """Return what is doubtful of the side that was taken to be the outside."""
    found = solution.outward
    if found.contradicts:
        return [
            "Scans see through each other: the surface seems to be inside out. Check cell.scanner.z_axis, or "
            "leave it out, so that the scans say it themselves."
        ]
    if found.certain:
        return []
    return [
        f"Which side of the surface is out is not certain (by {found.how}): look at the mesh, and set "
        "cell.scanner.z_axis if its inside is shown."
    ]


def _far_off(solution: MergeSolution) -> list[str]:
    """Return the scans that lie much farther off the others than is expected, with how far, the farthest first."""
    _, _, rms, expected = solution.overlap.per_scan.T
    return [
        f"{name} ({rms[number]:.3f} mm, {expected[number]:.3f} mm is expected)"
        for number, name in sorted(enumerate(solution.used), key=lambda one: -rms[one[0]])
        if rms[number] > _FAR_OFF * expected[number]
    ]


def _about_size(solution: MergeSolution) -> list[str]:
    """Return that the scans look like metres, where the half of them see less than a millimetre of the object."""
    seen = solution.patches
    across = [float(np.ptp(seen.points_mm[mine], axis=0).max()) for mine in seen.rows_of_scans() if len(mine)]
    if (
        not across
        or np.median(across) + seen.size_mm > _LEAST_SIZES * seen.size_mm
        or seen.size_mm > _LARGE_PATCH_MM
    ):
        return []
    return [
        f"Half of the scans see less than {np.median(across) + seen.size_mm:.2g} mm of the object: they look like "
        "metres, and millimetres are meant."
    ]


def _about_angles(groups: Sequence[ScanGroup], placement: Placement, solution: MergeSolution) -> list[str]:
    """Return the mistake in the table's angles with which the scans would fit together, if there is one."""
    by_name = {group.name: group.captures[0].table_deg for group in groups}
    degrees = [by_name[name] for name in solution.used]
    if placement.base_from_turntable is None or None in degrees:
        return []
    if len(set(degrees)) == 1:
        return [f"All scans have the table angle {degrees[0]:g}°: give each the angle at which it was taken."]
    turned = placement.direction * placement.scale * np.deg2rad(np.array(degrees, dtype=float))
    mistakes = {
        "the table turned the other way round: check turntable.direction, or the angles' sign": 2 * turned,
        "table_deg of the scans is in radians: multiply it by 180/π": turned - np.rad2deg(turned),
    }
    fitting: dict[str, int] = {}
    for words, angles in mistakes.items():
        other = overlap(solution.patches.turned(angles), None if solution.scatter else solution.errors)
        more = other.pairs > _MORE_PAIRS * solution.overlap.pairs
        if more and (solution.scatter or other.rms_mm <= _SUSPICIOUS * other.expected_rms_mm):
            fitting[words] = other.pairs
    return [f"The scans fit together if {max(fitting, key=fitting.__getitem__)}."] if fitting else []
