"""What tells how well scans fit once a mistake is taken back."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.causes.mirror import turned_round
from calib_core.findings.codes.causes import POINTS_MIRRORED
from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.fusion.outward import Outward, Sight, sight
from calib_core.fusion.overlap import Patches, SeenBy, joined_patches
from calib_core.fusion.solve import Fit, coarse, fit
from calib_core.records import Capture, Changes, Finding, RootCause

LEAST_PAIRS = 50
"""Fewer pairs of surfaces tell nothing."""

MORE = 1.4
"""Of the score, what there must be when a mistake is taken back."""

PATCH_SPACINGS = 2.0
"""How large a patch is at least, in distances between a scan's points."""

_ONE_SURFACE = 0.15  # of a patch
_SAME = 0.01  # of rotations' numbers


@dataclass(frozen=True, eq=False)
class Tried:
    """One mistake taken back: how well the scans fit then, and the finding it would be."""

    ways: FloatArray
    fit: Fit
    more: float
    finding: Callable[[Fit, Fit], Finding]


def mirrored(captures: Sequence[Capture], seen: Patches, where: Sequence[FloatArray]) -> Iterator[Tried]:
    """Give clouds of which one axis counts the other way; `where` their scanners stand, (4, 4) each."""
    if any(capture.kind != "cloud" for capture in captures):
        return
    for row, axis in enumerate("xyz"):
        mirror = np.eye(4)
        mirror[row, row] = -1
        ways = np.array([way @ mirror @ np.linalg.inv(way) for way in where])
        ids = [capture.id for capture in captures]
        remedy = remedy_of(
            "scaled-profile", Changes(captures={c.id: turned_round(c, axis) for c in captures}), ids
        )

        def finding(now: Fit, then: Fit, axis: str = axis, remedy: RootCause = remedy) -> Finding:
            pairs: dict[str, Any] = {"pairs_before": now.pairs, "pairs_after": then.pairs}
            return POINTS_MIRRORED(remedy.captures, remedy=remedy, of="scans", axis=axis, **pairs)

        yield Tried(ways, fit(seen, ways), MORE, finding)


def impossible_share(seen: Patches, ways: FloatArray, directions: FloatArray) -> float:
    """Return the share of surfaces one before the other that stand in a line of sight, after a transform."""
    there = seen.transformed(ways).in_voxels()
    looked = sight(there, np.einsum("sij,sj->si", ways[:, :3, :3], directions), _ONE_SURFACE * seen.size_mm)
    before, behind = float(looked.before.sum()), float(looked.behind.sum())
    return before / max(before + behind, 1.0)


def impossible_of_scan(found: Outward, scan: int, among: Sequence[int] | slice = slice(None)) -> float:
    """Return the same share of those that one scan is part of, with all others or some; 0 where they are few."""
    if found.sight is None:
        return 0.0
    sides = _sides(found.sight, found.sign)
    before, behind = (float(one[scan, among].sum() + one[among, scan].sum()) for one in sides)
    return before / (before + behind) if before + behind > LEAST_PAIRS else 0.0


def impossible_among(found: Outward, scans: Sequence[int]) -> float:
    """Return the same share of those between some scans."""
    if found.sight is None:
        return 0.0
    before, behind = (float(one[np.ix_(scans, scans)].sum()) for one in _sides(found.sight, found.sign))
    return before / max(before + behind, 1.0)


def _sides(sight: Sight, sign: int) -> tuple[FloatArray, ...]:
    return (sight.before, sight.behind)[::sign]


def pairs_with(seen: Patches, rows: Sequence[NDArray[np.int64]], one: tuple[str, SeenBy], size: float) -> bool:
    """Return whether a scan (its name, its patches) has surfaces in common with rows of those seen."""
    mine = joined_patches([one], size)
    others = np.concatenate(rows)
    both = replace(
        seen,
        names=("others", "one"),
        scans=np.concatenate([np.zeros(len(others), np.int64), np.ones(len(mine.scans), np.int64)]),
        points_mm=np.concatenate([seen.points_mm[others], mine.points_mm]),
        normals=np.concatenate([seen.normals[others], mine.normals]),
        variances_mm2=np.concatenate([seen.variances_mm2[others], mine.variances_mm2]),
        bounds=np.array([0, len(others) + len(mine.scans)]),
    )
    return fit(coarse(both.in_voxels())).pairs >= LEAST_PAIRS


def extent_mm(points: NDArray[np.floating]) -> float:
    """Return how far points (…, 3) reach along the longest axis; blanks do not count."""
    known = points[np.isfinite(points).all(axis=-1)]
    return float(np.ptp(known, axis=0).max()) if len(known) else 0.0


def about_z(angles_rad: FloatArray) -> FloatArray:
    """Return transforms (N, 4, 4) that turn about z."""
    ways = np.tile(np.eye(4), (len(angles_rad), 1, 1))
    for way, angle in zip(ways, angles_rad.tolist(), strict=True):
        way[:3, :3] = rotation_from_vector(np.array([0.0, 0.0, angle]))
    return ways


def same_arrangement(ways: FloatArray, others: FloatArray, size_mm: float) -> bool:
    """Return whether transforms (S, 4, 4) of scans place them to each other as others do, wherever all lie."""
    one, other = (np.linalg.inv(some[0]) @ some for some in (ways, others))
    turned, shifted = np.abs(one - other)[:, :3, :3].max(), np.abs(one - other)[:, :3, 3].max()
    return bool(turned < _SAME and shifted < _ONE_SURFACE * size_mm)


def remedy_of(kind: str, changes: Changes, captures: Sequence[str] = ()) -> RootCause:
    """Return what Apply does, as a root cause."""
    data = {"id": f"merge-{kind}", "kind": kind, "title": "", "sentence": "", "captures": list(captures)}
    return RootCause.model_validate({**data, "changes": changes})
