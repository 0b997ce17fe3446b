"""Several balls: which arc is of which ball, found by where a scanner on one mount sees all of them.

Any few arcs of one ball fix the mount about as well as a session of one ball does, and then every arc tells where
its ball is, on either side of the plane of light.  So mounts are sought from many random few, the one taken by
which most arcs come together in few places.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from calib_core.cell.layout import KnownDistance
from calib_core.chain.guesses import random_few, random_rotations
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.start import Centers, Start, centers_of, find_starts
from calib_core.frames import FloatArray

_DRAWS = 16_000
_FEW = 5
_BEST = 12
_ALIKE_MM = 1.5
_TOGETHER_MM = 4.0
_LEAST = 3
"""Arcs of a ball; fewer tell nothing of it."""
_WIDTHS_MM = (0.5, 2 * _ALIKE_MM)
"""Within which arcs are taken to be of one ball: of an arm that errs little, and of one that errs much."""
_SHARPEST_MM = 0.05  # arcs that come together more closely are as good
_AS_CLOSE = 6.0  # times as far apart as the first ball's arcs may be those of another
_TURNED = 0.9998  # the cosine of a degree: what is always beside a ball stands still, too, until the flange turns
_MOST_BALLS = 8
_CLEARLY = 13.8  # of squared deviations: a thousand times less likely
_CONTRADICTS = 20.0  # of squared deviations a distance: one that is told wrongly by 0.2 mm has 35 and more
_NO_MORE = 0.8  # of the arcs: where one ball has so many, the others are stray


@dataclass(frozen=True, eq=False)
class Balls:
    """Arcs by their balls.

    Attributes
    ----------
    ball : (K,) int
        Which ball each is of, those with most arcs first; −1: of none.
    centers : (B, 3)
        Where they are in what carries them, mm.
    misfit_mm : (K,)
        How far each arc lies from its ball; infinite for those of none.
    size : (B,) int
        Which of the sizes that they may have the balls have.
    """

    ball: np.ndarray
    centers: FloatArray
    misfit_mm: FloatArray
    size: np.ndarray


def labelled(
    observations: Observations, sphere: SphereSize, groups: Sequence[np.ndarray]
) -> list[SphereObservation] | None:
    """Return the arcs of each scanner's group with the names of their balls; None where none come together.

    The names are `sphere-1`, `sphere-2`, …, in the order of how many arcs each has, and empty for arcs of none.
    Of a scanner that sees one ball each capture has one arc: the ball's, else the first.  Where all see one ball
    only, all have the same name.  Where sizes are open, each ball has the one by which its arcs come together.
    """
    names, places = [""] * len(observations), list[tuple[str, FloatArray]]()
    sizes = [o.sphere for o in observations]
    several = False
    for some in groups:
        arcs = [observations[k] for k in some]
        open_to = tuple(dict.fromkeys(size for o in arcs if o.sphere is None for size in o.sizes))
        found = balls_of([_centers(arcs, size, sphere) for size in open_to or (None,)])
        if found is None:
            return None
        alone = len(found.centers) < 2 or np.mean(found.ball == 0) > _NO_MORE
        several |= not alone
        carrier = observations[some[0]].carriers.ball
        own = [_place(places, carrier, center) for center in found.centers[: 1 if alone else None]]
        chosen = _one_each([observations[k] for k in some], found) if alone else found.ball
        for k, n in zip(some, chosen, strict=True):
            names[k] = f"sphere-{own[n] + 1}" if n >= 0 else ""
            if open_to and n >= 0:
                sizes[k] = open_to[found.size[n]]
    if not several:
        names = [name and "sphere-1" for name in names]
    return [replace(o, ball=n, sphere=size) for o, n, size in zip(observations, names, sizes, strict=True)]


def _centers(arcs: Observations, size: SphereSize | None, sphere: SphereSize) -> Centers:
    """Return the centres of arcs, those of an open size as of one."""
    return centers_of([replace(o, sphere=o.sphere or size) for o in arcs] if size else arcs, sphere)


def _one_each(observations: Observations, found: Balls) -> np.ndarray:
    """Return 0 for the arc of each profile that is of the first ball, for its first arc without one, −1 else."""
    chosen, profiles = np.full(len(observations), -1), dict[tuple[str, bytes], list[int]]()
    for k, o in enumerate(observations):  # of a sweep each has a pose of its own
        profiles.setdefault((o.capture, o.base_from_tool0.matrix.tobytes()), []).append(k)
    for own in profiles.values():
        chosen[min(own, key=lambda k: found.misfit_mm[k] if found.ball[k] == 0 else np.inf)] = 0
    return chosen


def _place(places: list[tuple[str, FloatArray]], carrier: str, center: FloatArray) -> int:
    """Return the number of a place among those that scanners before found, or a new one's."""
    for n, (other, at) in enumerate(places):
        if other == carrier and np.linalg.norm(at - center) < 2 * _TOGETHER_MM:
            return n
    places.append((carrier, center))
    return len(places) - 1


def balls_of(by_size: Sequence[Centers]) -> Balls | None:
    """Return which ball each arc is of by the mount that brings most together; None where none brings enough.

    `by_size`: the arcs' centres if all balls had one size, and another.
    """
    best: Balls | None = None
    for some in _of_one_ball(by_size[0]):
        for centers in by_size:
            start = find_starts(centers.chosen(some))[0]
            if start.scatter_mm > _ALIKE_MM:
                continue
            found = gathered(by_size, start)
            if best is None or _better(found, best):
                best = found
    return best


def _better(one: Balls, other: Balls) -> bool:
    return _worth(one) > _worth(other)


def _worth(found: Balls) -> tuple[float, int]:
    """Return how much likelier arcs are so than anywhere, as many as come together, the closer the more."""
    of_any = found.ball >= 0
    near_mm = max(float(np.median(found.misfit_mm[of_any])), _SHARPEST_MM) if of_any.any() else _TOGETHER_MM
    return float(of_any.sum() * np.log(_TOGETHER_MM / near_mm)), -len(found.centers)


def _of_one_ball(centers: Centers) -> list[np.ndarray]:
    """Return masks (K,) of arcs that a mount has in one place by x and z alone, the largest first."""
    count = len(centers.measured)
    if count < _FEW + 1:
        return []
    weight = np.ones_like(centers.measured)
    weight[:, 1] = np.where(centers.open_side, 0.0, centers.height_weight)
    sought = centers.sought(weight)
    few, rotations = sought.chosen(random_few(_DRAWS, np.ones(count), _FEW)), random_rotations(_DRAWS)
    rotations, linear, misfit = few.refined(rotations, few.linear_unknowns(rotations), 10)
    fits = np.flatnonzero(few.distances(misfit).max(axis=1) < _ALIKE_MM)
    fits = fits[np.argsort(few.distances(misfit)[fits].max(axis=1))][:2000]
    if not len(fits):
        return []
    off = sought.distances(sought.misfit(rotations[fits], linear[fits]))
    masks: dict[bytes, np.ndarray] = {}
    for number, width_mm in enumerate(_WIDTHS_MM, start=1):
        for n in np.argsort(-(off < width_mm).sum(axis=1), kind="stable"):
            mask = off[n] < width_mm
            if mask.sum() > _FEW:
                masks.setdefault(mask.tobytes(), mask)
            if len(masks) >= number * _BEST:
                break
    return list(masks.values())


def gathered(by_size: Sequence[Centers], start: Start) -> Balls:
    """Return the balls that a mount puts arcs together in, one after the other, the fullest first."""
    each = [candidates(centers, start.rotation, start.translation) for centers in by_size]
    both, rotations = np.concatenate(each, axis=1), by_size[0].rotations
    ball, misfit = np.full(len(both), -1), np.full(len(both), np.inf)
    places, stray, most_mm = list[FloatArray](), np.zeros(len(both), dtype=bool), np.inf
    sizes: list[int] = []
    while len(places) < _MOST_BALLS:
        free = np.flatnonzero((ball < 0) & ~stray)
        if len(free) < _LEAST:
            break
        flat = both[free].reshape(-1, 3)
        apart = np.linalg.norm(both[free][:, None] - flat[None, :, None], axis=3).min(axis=2)
        fullest = int(np.argmax((apart < _TOGETHER_MM).sum(axis=0) - 1e-3 * np.median(apart, axis=0)))
        some = free[apart[:, fullest] < _TOGETHER_MM]
        if len(some) < _LEAST:
            break
        size, place, own = _of_one_size([one[some] for one in each])
        if len(each) > 1:  # what came together as of another size is not of this ball
            some, own = some[own < _TOGETHER_MM], own[own < _TOGETHER_MM]
        if len(some) < _LEAST:
            break
        if places and (np.median(own) > most_mm or _orientations(rotations[some]) < _LEAST):
            stray[some] = True
            continue
        most_mm = min(most_mm, _AS_CLOSE * max(float(np.median(own)), _SHARPEST_MM))
        ball[some], misfit[some] = len(places), own
        places.append(place)
        sizes.append(size)
    return Balls(ball, np.array(places).reshape(-1, 3), misfit, np.array(sizes, dtype=int))


def _of_one_size(each: Sequence[FloatArray]) -> tuple[int, FloatArray, FloatArray]:
    """Return the size by which arcs come together most closely, their place, and how far each is from it."""
    tried = [(n, *middle_of(both)) for n, both in enumerate(each)]
    return min(tried, key=lambda one: float(np.median(one[2])))


def _orientations(rotations: FloatArray) -> int:
    """Return how many of orientations (K, 3, 3) differ."""
    apart: list[FloatArray] = []
    for one in rotations:
        if all((np.sum(one * other) - 1) / 2 < _TURNED for other in apart):
            apart.append(one)
    return len(apart)


def candidates(centers: Centers, rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """Return where each arc's ball may be by a mount, on either side of the plane of light, (K, 2, 3)."""
    seen = np.repeat(centers.measured[:, None], 2, axis=1)
    seen[:, 1, 1] *= np.where(centers.open_side, -1.0, 1.0)
    carried = seen @ rotation.T + translation
    return np.einsum("kij,ksj->ksi", centers.rotations, carried) + centers.translations[:, None]


def middle_of(both: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the place (3,) on which arcs (K, 2, 3), each on either side, agree, and how far each is from it."""
    flat = both.reshape(-1, 3)
    place = flat[int(np.argmin(np.median(_nearest(both, flat)[1], axis=1)))]
    for _ in range(4):
        chosen, _ = _nearest(both, place[None])
        place = np.median(chosen[0], axis=0)
    return place, _nearest(both, place[None])[1][0]


def _nearest(both: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the nearer side of each arc to each place, (P, K, 3), and how far it is, (P, K)."""
    apart = np.linalg.norm(both[None] - places[:, None, None], axis=3)
    side = np.argmin(apart, axis=2)
    return both[np.arange(len(both))[None], side], np.min(apart, axis=2)


def by_distances(
    centers: FloatArray, covariance: FloatArray, names: Sequence[str], distances: Sequence[KnownDistance]
) -> list[list[str]]:
    """Return the namings of balls that fit told distances: several only where all mean the same measurements.

    None fits within what places and distances err, or some that differ fit as well: an empty list.

    Parameters
    ----------
    centers, covariance : (B, 3), (3 B, 3 B)
        Of balls, as found without the distances.
    names, distances : sequence
        As told.
    """
    found: list[tuple[float, float, list[str], set[tuple[frozenset[int], float]]]] = []
    for given in permutations(names, len(centers)) if len(names) >= len(centers) else ():
        place = {name: n for n, name in enumerate(given)}
        both = [(place[d.one], place[d.other], d) for d in distances if {d.one, d.other} <= place.keys()]
        if both:
            off, squared = _off_told(centers, covariance, both)
            found.append((squared, off, [*given], {(frozenset((i, j)), d.mm) for i, j, d in both}))
    found.sort(key=lambda one: one[0])
    if not found or found[0][1] > _TOGETHER_MM:
        return []
    likeliest, *_, same = found[0]
    if likeliest > _CONTRADICTS * len(same):
        return []
    limit = likeliest + _CLEARLY * max(1.0, likeliest / len(same))  # where all fit badly, less is told by it
    fit = [one for one in found if one[0] < limit]
    return [given for *_, given, _ in fit] if all(one[-1] == same for one in fit) else []


def wrong_distance(
    centers: FloatArray, covariance: FloatArray, names: Sequence[str], distances: Sequence[KnownDistance]
) -> tuple[KnownDistance, float] | None:
    """Return the one distance that contradicts all others, and what it is by what was found; None where not one.

    Parameters as of `by_distances`.
    """
    found: list[tuple[KnownDistance, float]] = []
    for known in distances:
        others = [other for other in distances if other is not known]
        named = by_distances(centers, covariance, names, others)
        if len(named) == 1 and {known.one, known.other} <= {*named[0]}:
            one, other = (centers[named[0].index(name)] for name in (known.one, known.other))
            found.append((known, float(np.linalg.norm(one - other))))
    return found[0] if len(found) == 1 else None


def _off_told(
    centers: FloatArray, covariance: FloatArray, told: Sequence[tuple[int, int, KnownDistance]]
) -> tuple[float, float]:
    """Return the most by which distances are not as told, mm, and in standard deviations, squared."""
    off, moves = np.zeros(len(told)), np.zeros((len(told), *centers.shape))
    for n, (i, j, known) in enumerate(told):
        apart = centers[i] - centers[j]
        length = float(np.linalg.norm(apart))
        off[n], moves[n, i], moves[n, j] = length - known.mm, apart / length, -apart / length
    moved = moves.reshape(len(told), -1)
    spread = moved @ covariance @ moved.T + np.diag([known.sigma_mm**2 for *_, known in told])
    return float(np.abs(off).max()), float(off @ np.linalg.solve(spread, off))
