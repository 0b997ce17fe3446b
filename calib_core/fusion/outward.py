"""Which way is out: on which side of the surface the scanner stood, from the scans themselves.

A scan's surface is seen from its scanner's side.  A depth may count away from the scanner or toward it, and files
do not say.  Three things in the data do:

- **who sees whom**: what another scan has seen cannot stand between a scanner and the surface that it saw.  Where
  surfaces lie one before the other along a scan's line of sight, the scanner stood on the side of its own.
- **rays**: columns of a grid run apart with the distance to a scanner whose rays come out of one place.
- **volume**: the surface of a solid that was seen from all around, with its normals inward, has a negative volume.

Of these the first wins: a cavity, or a sheet seen from one side, has a negative volume and is right.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.fusion.overlap import Patches
from calib_core.fusion.scan import Scan, SingleArray

How = Literal["told", "ball", "visibility", "rays", "volume", "distance", "assumed"]

_MOST_LOOKED_AT = 20_000
_FEWEST_SEEN = 30  # patches one before the other, that tell who sees whom
_LEAST_SHARE = 0.005  # of all that were looked at
_CLEAR = 0.8  # of those one before the other lie behind
_STEEPEST = 5.0  # tangent of the incidence
_SURE = 6.0  # standard deviations of the rays' spreading
_MOST_LINES = 300
_FEWEST_LINES, _FEWEST_IN_LINE = 8, 8
_CLOSED = 0.2  # of its area, what is missing of a surface seen from all around
_SOLID = 0.05  # of the volume of a ball with the same area
_FAR = 2.0  # a scanner's own zero lies so many depths before what it sees


class View(NamedTuple):
    """How a scan was taken, as far as it says itself.

    Attributes
    ----------
    direction : (3,)
        Of sight in T: the z axis of L, as it is taken to look.
    spreading : float
        By how much of itself the distance of rays grows with each mm along `direction`; NaN without a grid.
    spreading_sigma : float
    depth_mm, depth_range_mm : float
        Along `direction`: the middle of its points and what the middle nine tenths of them span.
    told : bool
        Whether it was told which way its z axis looks.
    """

    direction: FloatArray
    spreading: float
    spreading_sigma: float
    depth_mm: float
    depth_range_mm: float
    told: bool = False


class Sight(NamedTuple):
    """Patches of other scans that lie before and behind a scan's own along its line of sight, of those compared.

    All are (S, S) arrays: of scan j beside scan i at [i, j].  Before it nothing can lie, where poses and
    directions are right.
    """

    before: FloatArray
    behind: FloatArray
    compared: FloatArray


@dataclass(frozen=True)
class Outward:
    """Which way is out.

    Parameters
    ----------
    sign : {1, -1}
        −1: the scans look the other way than they are taken to.
    how : str
    certain : bool
        Whether what decided leaves no doubt.
    before, behind : float
        Shares of the patches compared that lie before and behind a scan's own, as it was taken to look.
    volume : float
        Of the merged surface beside a ball's of the same area, as it was taken; NaN where nothing was seen.
    missing : float
        Of a closed surface: 0 where it was seen from all around, 1 of a flat one.
    contradicts : bool
        Whether who sees whom says the contrary of what decided.
    sight : Sight or None
        Of all scans, as they were taken to look.
    """

    sign: Literal[1, -1]
    how: How
    certain: bool
    before: float
    behind: float
    volume: float
    missing: float
    contradicts: bool = False
    sight: Sight | None = None

    @property
    def impossible(self) -> float:
        """Share of patches one before the other that stand in another scan's line of sight: in rubble, a half."""
        shares = (self.before, self.behind)
        return shares[0 if self.sign > 0 else 1] / max(sum(shares), 1e-12)


def view_of(scan: Scan) -> View:
    """Return how a scan was taken."""
    points, sight = scan.points_in_laser_mm, scan.sight
    points = points[tuple(slice(None, None, 1 + many // _MOST_LINES) for many in points.shape[:2])]
    depth = (scan.looks_along_z or 1) * points[..., 2].astype(float)
    low, mid, high = np.nanpercentile(depth, (5, 50, 95)).tolist()
    spreading, sigma = _spreading(points, depth) if scan.organised else (float("nan"), float("nan"))
    return View(sight[len(sight) // 2], spreading, sigma, mid, high - low, scan.looks_along_z is not None)


def _spreading(points: SingleArray, depth: FloatArray) -> tuple[float, float]:
    """Return the clearer one of the spreadings of columns in x and of rows in y, with its standard deviation."""
    found = [_of_lines(points[..., 0].astype(float), depth), _of_lines(points[..., 1].T.astype(float), depth.T)]
    known = [one for one in found if np.isfinite(one[0]) and one[1] > 0]
    return max(known, key=lambda one: abs(one[0]) / one[1]) if known else (float("nan"), float("nan"))


def _of_lines(across: FloatArray, depth: FloatArray) -> tuple[float, float]:
    """Return how `across`, nearly the same along each column, spreads with depth, and its standard deviation.

    In each column it changes with the depth by a slope; where rays come out of one place, slopes are as their
    columns' places.
    """
    known = np.isfinite(across) & np.isfinite(depth)
    count = known.sum(axis=0)
    use = count >= _FEWEST_IN_LINE
    if np.count_nonzero(use) < _FEWEST_LINES:
        return float("nan"), float("nan")
    known, count = known[:, use], count[use]
    across, depth = np.where(known, across[:, use], 0.0), np.where(known, depth[:, use], 0.0)
    place, middle = across.sum(axis=0) / count, depth.sum(axis=0) / count
    off, deep = np.where(known, across - place, 0.0), np.where(known, depth - middle, 0.0)
    spread = (deep**2).sum(axis=0)
    slope = (off * deep).sum(axis=0) / np.maximum(spread, 1e-12)
    rest = np.sqrt(((off - slope * deep) ** 2).sum() / count.sum())
    pitch = np.median(np.abs(np.diff(place)))
    if not rest < 0.3 * pitch or not spread.sum() > 0:
        return float("nan"), float("nan")  # lines that are no rays
    design = np.column_stack([place, np.ones_like(place)])
    weighted = design * spread[:, None]
    inverse = np.linalg.pinv(design.T @ weighted)
    fit = inverse @ (weighted.T @ slope)
    misfit = (spread * (slope - design @ fit) ** 2).sum() / max(len(place) - 2, 1)
    floor = max(rest, 1e-5) ** 2
    return float(fit[0]), float(np.sqrt(max(misfit, floor) * inverse[0, 0]))


def sight(seen: Patches, directions: FloatArray, tolerance_mm: float) -> Sight:
    """Return who sees whom.

    Parameters
    ----------
    seen : Patches
    directions : (S, 3)
        Of each scan's sight in T, unit.
    tolerance_mm : float
        Surfaces nearer to each other than this are one.
    """
    every = np.arange(0, len(seen.scans), max(1, len(seen.scans) // _MOST_LOOKED_AT))
    points, owners = seen.points_mm[every], seen.scans[every]
    count = len(seen.names)
    counts = np.zeros((3, count, count))
    for number, mine in enumerate(seen.rows_of_scans()):
        if not len(mine):
            continue
        of_others = owners != number
        told = _before_and_behind(
            seen.points_mm[mine],
            seen.normals[mine],
            points[of_others],
            directions[number],
            seen.size_mm,
            tolerance_mm,
        )
        whose = owners[of_others]
        for kind, some in enumerate((*told, np.ones(len(whose), bool))):
            counts[kind, number] = np.bincount(whose[some], minlength=count)
    return Sight(*counts)


def _before_and_behind(
    own: FloatArray, normals: FloatArray, others: FloatArray, toward: FloatArray, cell: float, tolerance: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which of the others lie before and behind a scan's own patches, in cells across its sight."""
    first = np.eye(3)[np.argmin(np.abs(toward))]
    across = np.cross(toward, first)
    across /= np.linalg.norm(across)
    axes = np.column_stack([across, np.cross(toward, across), toward])
    p, n, q = ((one @ axes).astype(float) for one in (own, normals, others))
    low = np.minimum(p[:, :2].min(axis=0), q[:, :2].min(axis=0)) if len(q) else p[:, :2].min(axis=0)
    keys, wanted = (_cells(one[:, :2] - low, cell) for one in (p, q))
    order = np.lexsort((p[:, 2], keys))
    keys, p, n = keys[order], p[order], n[order]
    first_at, after = np.searchsorted(keys, wanted), np.searchsorted(keys, wanted, side="right")
    met = after > first_at
    q, nearest, farthest = q[met], first_at[met], after[met] - 1
    before, behind = np.zeros(len(met), bool), np.zeros(len(met), bool)
    before[met] = _gap(p, n, q, nearest, cell) < -tolerance
    behind[met] = -_gap(p, n, q, farthest, cell, -1.0) > tolerance
    return before, behind


def _gap(
    p: FloatArray, n: FloatArray, q: FloatArray, at: NDArray[np.int64], cell: float, side: float = 1.0
) -> FloatArray:
    """Return how far q lie beyond the planes of p[at], less what a bent or steep surface may cause."""
    facing = np.maximum(np.abs(n[at, 2]), 1e-3)
    steep = np.minimum(np.hypot(n[at, 0], n[at, 1]) / facing, _STEEPEST)
    steep[~n[at].any(axis=1)] = _STEEPEST  # beside an edge
    slope = -n[at, :2] / np.where(n[at, 2] < 0, -facing, facing)[:, None]
    long = np.linalg.norm(slope, axis=1)
    slope *= (np.minimum(long, _STEEPEST) / np.maximum(long, 1e-12))[:, None]
    there = p[at, 2] + ((q[:, :2] - p[at, :2]) * slope).sum(axis=1)
    doubt = 0.25 * cell * steep
    gap = side * (q[:, 2] - there)
    return np.where(gap < 0, np.minimum(gap + doubt, 0.0), np.maximum(gap - doubt, 0.0))


def _cells(places: FloatArray, cell: float) -> NDArray[np.int64]:
    index = np.floor(places / cell).astype(np.int64)
    return index[:, 0] * (1 << 31) + index[:, 1]


def _solid(seen: Patches) -> tuple[float, float]:
    """Return the surface's volume beside a ball's of the same area, and what is missing of a closed one."""
    if not len(seen.scans):
        return float("nan"), 1.0
    starts = seen.bounds[:-1]
    counts = np.diff(seen.bounds)[:, None]
    normals = np.add.reduceat(seen.normals, starts)
    lengths = np.linalg.norm(normals, axis=1)
    one = lengths > 0.5 * counts[:, 0]  # both sides of a thin sheet share a voxel: it bounds nothing
    if not one.any():
        return 0.0, 1.0
    normals = normals[one] / lengths[one, None]
    points = (np.add.reduceat(seen.points_mm, starts) / counts)[one]
    areas = seen.size_mm**2 / np.abs(normals).sum(axis=1)  # of the surface within an occupied voxel, in the mean
    area = float(areas.sum())
    volume = float((areas[:, None] * normals * (points - points.mean(axis=0))).sum()) / 3
    missing = float(np.linalg.norm((areas[:, None] * normals).sum(axis=0))) / area
    return volume / (area**1.5 / (6 * np.sqrt(np.pi))), missing


def outward(
    seen: Patches, views: Sequence[View], tolerance_mm: float, ball: Literal[1, -1] | None = None
) -> Outward:
    """Return which way is out.

    Parameters
    ----------
    seen : Patches
        With normals toward the scanner, as the views take it to look.
    views : sequence of View
        One a scan.
    tolerance_mm : float
        Surfaces nearer to each other than this are one.
    ball : {1, -1}, optional
        What captures of the ball say: 1 where they agree with the views.

    Where the user said how the scanner's depth counts, that is taken; what contradicts it is told.
    """
    looked = sight(seen, np.array([view.direction for view in views]), tolerance_mm)
    compared = max(float(looked.compared.sum()), 1.0)
    before, behind = float(looked.before.sum()), float(looked.behind.sum())
    volume, missing = _solid(seen)
    enough = before + behind >= max(_FEWEST_SEEN, _LEAST_SHARE * compared)
    share = behind / max(before + behind, 1.0)
    by_sight = 0 if not enough else 1 if share >= _CLEAR else -1 if share <= 1 - _CLEAR else 0
    by_rays, by_volume = _by_rays(views), int(np.sign(volume)) if abs(volume) >= _SOLID else 0

    def found(sign: int, how: How, certain: bool) -> Outward:
        against = by_sight == -sign
        return Outward(
            1 if sign > 0 else -1, how, certain and not against, before / compared, behind / compared,
            volume, missing, against, looked,
        )  # fmt: skip

    if any(view.told for view in views):
        return found(1, "told", True)
    if ball is not None:
        return found(ball, "ball", True)
    if by_sight:
        return found(by_sight, "visibility", by_rays != -by_sight)
    if by_rays:
        return found(by_rays, "rays", True)
    if by_volume:
        return found(by_volume, "volume", missing <= _CLOSED)
    depths = np.array([(view.depth_mm, view.depth_range_mm) for view in views])
    if len(depths) and (np.abs(depths[:, 0]) > _FAR * depths[:, 1]).all() and len(set(np.sign(depths[:, 0]))) == 1:
        return found(int(np.sign(depths[0, 0])), "distance", True)
    return found(1, "assumed", False)


def _by_rays(views: Sequence[View]) -> int:
    """Return what the rays' spreading says, 0 for nothing."""
    told = [view for view in views if view.spreading_sigma > 0]
    if not told:
        return 0
    weights = np.array([1 / view.spreading_sigma**2 for view in told])
    values = np.array([view.spreading for view in told])
    sure = np.abs(values) * np.sqrt(weights) > _SURE
    if not sure.any():
        return 0
    ways = np.sign(values[sure])
    return int(ways[0]) if (ways == ways[0]).mean() > _CLEAR or (ways == ways[0]).all() else 0
