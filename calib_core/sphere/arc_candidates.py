"""Where in a profile could an arc be?  Circles through three points of it, ranked by how many points they explain.

A profile is ordered along the stripe, so an arc is a run of it: windows of every length slide over the order and
each gives the circle through its two ends and its middle.  Triples drawn at random (always the same ones) from
windows add what a stray point at an end or middle would spoil.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.sphere.circle import circles_through, median_of

BAND = 0.02
"""Half width of the band in which a candidate counts its points, as a share of its radius."""

_SCORED_POINTS = 400
_RANDOM_TRIPLES = 400
_LEAST_TRIPLE_EXTENT_RAD = np.deg2rad(14.0)
_MOST = 10


def arc_candidates(points: FloatArray, largest_mm: float = np.inf) -> tuple[FloatArray, FloatArray]:
    """Return distinct candidate circles (K ≤ 10, 3) as x, z, r, best first, and the support (K,) of each.

    The support is an estimate of the number of points within the band about the circle, less as many as a
    background of the density beside the band would put there.

    Parameters
    ----------
    points : (N, 2)
        Finite, in the order of the stripe or in none.
    largest_mm : float
        No circle is larger.
    """
    ordered = points[stripe_order(points)]
    origin = ordered.mean(axis=0)
    ordered = ordered - origin
    circles = _circles_of(ordered, _triples(len(ordered)))
    size = float(np.hypot(*np.ptp(ordered, axis=0)))
    circles = circles[circles[:, 2] < min(4 * size, largest_mm)]
    if len(circles) == 0:
        return np.zeros((0, 3)), np.zeros(0)
    step = max(1, len(ordered) // _SCORED_POINTS)
    support = _support(ordered[::step], circles) * step
    chosen = _distinct(circles, support)
    return circles[chosen] + np.array([*origin, 0.0]), support[chosen]


def stripe_order(points: FloatArray) -> NDArray[np.intp]:
    """Return the order in which neighbours are nearest: as given, or along x where the points come shuffled."""
    given = np.arange(len(points))
    along_x = np.lexsort((points[:, 1], points[:, 0]))
    return min((given, along_x), key=lambda order: _typical_step(points[order]))


def _typical_step(points: FloatArray) -> float:
    steps = np.abs(points[1:] - points[:-1])
    return median_of(steps[:, 0] + steps[:, 1])


@lru_cache(maxsize=64)
def _triples(count: int) -> NDArray[np.intp]:
    """Return the indices (K, 3) of three points each: sliding windows of all lengths, then random ones.

    A scanner's profiles often have the same number of points, and the same random triples are drawn each time.
    """
    triples: list[NDArray[np.intp]] = []
    span = float(count - 1)
    shortest = max(8.0, count / 64)
    while span >= min(shortest, count - 1):
        whole = int(span)
        starts = np.arange(0, count - whole, max(1, whole // 4))
        triples.append(np.column_stack([starts, starts + whole // 2, starts + whole]))
        span /= np.sqrt(2)
    random = np.random.default_rng(20240117)
    length = np.exp(random.uniform(np.log(shortest), np.log(max(count, shortest + 1)), _RANDOM_TRIPLES))
    first = random.uniform(0, np.maximum(count - length, 1))
    drawn = (first[:, None] + np.sort(random.uniform(size=(_RANDOM_TRIPLES, 3)), axis=1) * length[:, None]).astype(
        int
    )
    triples.append(np.minimum(drawn, count - 1))
    all_of_them = np.concatenate(triples)
    all_of_them.setflags(write=False)
    return all_of_them


def _circles_of(points: FloatArray, triples: NDArray[np.intp]) -> FloatArray:
    """Return the circles through the triples whose points span an arc long enough to be told from a line."""
    a, b, c = (points[triples[:, k]] for k in range(3))
    circles = circles_through(a, b, c)
    longest2 = np.maximum(_squared(c - a), np.maximum(_squared(b - a), _squared(c - b)))
    with np.errstate(invalid="ignore", over="ignore"):
        bent = longest2 > (circles[:, 2] * 2 * np.sin(_LEAST_TRIPLE_EXTENT_RAD / 2)) ** 2
    return circles[np.isfinite(circles).all(axis=1) & bent & (circles[:, 2] > 0)]


def _squared(offset: FloatArray) -> FloatArray:
    return offset[:, 0] ** 2 + offset[:, 1] ** 2


def _support(points: FloatArray, circles: FloatArray) -> FloatArray:
    """Return how many points each circle explains beyond the background's share.

    To first order d² − r² is 2r times the distance to the circle, and all of them are one matrix product.
    """
    x, z, r = circles.T
    of_points = np.column_stack([points, (points**2).sum(axis=1), np.ones(len(points))]).astype(np.float32)
    of_circles = np.column_stack([-2 * x, -2 * z, np.ones(len(x)), x**2 + z**2 - r**2]).astype(np.float32)
    misfit = of_circles @ of_points.T
    np.abs(misfit, out=misfit)
    band = BAND * r
    inside = _count(misfit < (2 * r * band).astype(np.float32)[:, None])
    beside = _count(misfit < (6 * r * band).astype(np.float32)[:, None]) - inside
    return inside - beside / 2


def _count(mask: NDArray[np.bool_]) -> FloatArray:
    return np.add.reduce(mask.view(np.uint8), axis=1, dtype=np.uint16).astype(float)


def _distinct(circles: FloatArray, support: FloatArray) -> list[int]:
    """Return the indices of the best circles, best first, that are not nearly the same as a better one."""
    left = support.copy()
    near2 = (0.25 * circles[:, 2]) ** 2
    chosen: list[int] = []
    while len(chosen) < _MOST:
        index = int(np.argmax(left))
        if not left[index] > 0:
            break
        chosen.append(index)
        apart2 = (circles - circles[index]) ** 2
        alike = (apart2[:, 0] + apart2[:, 1] < near2) & (apart2[:, 2] < near2)
        left[alike] = -np.inf
        left[index] = -np.inf
    return chosen
