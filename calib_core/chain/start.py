"""Where the likelihood starts: tool, sphere and sides from the captures' own sphere centres, whatever the motions.

A profile tells x and z of the sphere's centre in L and |y|, but not the side.  Leaving y out first removes the
2ᴷ choices: x and z alone fix the rotation, the sphere's centre and two components of the translation.  The
third is one number on which all captures must agree, so their |y| vote for it, and the sides follow.  Rotations
are searched from everywhere (all at once, in arrays), with a robust loss, by all captures and by random few of
them: neither pure translations nor clean captures are needed.  What comes out is a start, good to about the
scatter of the centres.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.guesses import Sought, apart, random_few, random_rotations
from calib_core.chain.observations import Observations, SphereSize
from calib_core.frames import FloatArray

_STARTS = 240
_KEPT = 200
_BEST = 12  # guesses that all captures of a long session are asked about
_SEARCH_CAPTURES = 40  # more do not make the search safer, only slower
# Two wrong captures of eight hide the answer from a search by all.  Among so many searches by so few captures
# some are by good ones alone.
_STARTS_BY_FEW = 480
_FEW = 5
_BESIDE_MM = 5.0  # from its told side a sphere is no nearer
_ALIKE_RAD, _ALIKE_MM = 0.02, 10.0  # captures of poses so near to each other say one thing, not many


@dataclass(frozen=True, eq=False)
class Centers:
    """The captures' own sphere centres and poses, as arrays.

    Attributes
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        From what carries the scanner into what carries the ball.
    measured : (K, 3)
        In L, mm; y is |y| where the side is open.
    open_side : (K,)
        True for profiles whose side is not fixed.
    height_weight : (K,)
        Weight of y against x and z, 0 … 1: small near a great circle, where y is hardly known.
    """

    rotations: FloatArray
    translations: FloatArray
    measured: FloatArray
    open_side: np.ndarray
    height_weight: FloatArray

    def chosen(self, which: np.ndarray) -> "Centers":
        """Return only some captures."""
        return Centers(
            self.rotations[which],
            self.translations[which],
            self.measured[which],
            self.open_side[which],
            self.height_weight[which],
        )

    @property
    def shares(self) -> FloatArray:
        """By how much each capture counts (K,): those of poses that are nearly one count as one together."""
        turned = np.einsum("aij,bij->ab", self.rotations, self.rotations)
        near = turned > 1 + 2 * np.cos(_ALIKE_RAD)
        apart = np.linalg.norm(self.translations[:, None] - self.translations[None], axis=2)
        return 1 / np.count_nonzero(near & (apart < _ALIKE_MM), axis=1)

    def sought(self, weight: FloatArray) -> Sought:
        """Return the same for a search, with a weight (K, 3) of each centre's components."""
        return Sought(self.rotations[None], self.translations[None], self.measured[None], weight[None])


@dataclass(frozen=True, eq=False)
class Start:
    """A guess of the unknowns: mount_from_laser, the sphere's centre, each capture's side and its misfit.

    Attributes
    ----------
    rotation, translation, center : (3, 3), (3,), (3,)
    sides : (K,)
        ±1; 0 where a capture has no side to choose.
    misfit_mm : (K,)
        Distance of each capture's own centre from the guessed one, y weighted.
    shares : (K,)
        As of `Centers`.
    scatter_mm : float
        Robust scale of the misfits (median, by shares).
    rival_scatter_mm : float or None
        The same for the best guess with other sides.
    """

    rotation: FloatArray
    translation: FloatArray
    center: FloatArray
    sides: np.ndarray
    misfit_mm: FloatArray
    shares: FloatArray
    scatter_mm: float
    rival_scatter_mm: float | None


def centers_of(observations: Observations, sphere: SphereSize) -> Centers:
    """Return the captures' own sphere centres and poses as arrays."""
    measured = np.array([o.sphere_center_in_laser_mm(sphere, o.side or 1) for o in observations])
    zone = np.array([(o.circle_radius_mm or 0.0) / o.size(sphere).radius_mm for o in observations])
    # An error of the circle's radius reaches y multiplied by r/|y|.
    magnification = zone / np.sqrt(np.maximum(1 - zone**2, 4e-4))
    return Centers(
        rotations=np.array([o.ball_from_scanner.rotation for o in observations]),
        translations=np.array([o.ball_from_scanner.translation_mm for o in observations]),
        measured=measured,
        open_side=np.array([o.circle_radius_mm is not None and o.side is None for o in observations]),
        height_weight=1 / np.maximum(magnification, 1.0),
    )


def find_start(centers: Centers) -> Start:
    """Return the guess on which most captures agree, of at least four."""
    return find_starts(centers)[0]


def find_starts(centers: Centers) -> list[Start]:
    """Return the guess on which most captures agree, then the best one of each other choice of sides.

    Parameters
    ----------
    centers : Centers
        Of at least four captures.
    """
    count = len(centers.measured)
    some = np.arange(count)
    if count > _SEARCH_CAPTURES:
        some = np.unique(np.linspace(0, count - 1, _SEARCH_CAPTURES).astype(int))
    few = centers.chosen(some)
    starts = sorted(settled(few, _candidates(few)), key=badness)
    if len(some) < count:
        guesses = [(s.rotation, s.translation, s.center) for s in starts[:_BEST]]
        starts = sorted(settled(centers, guesses), key=badness)
    likely = [s for s in starts[1:] if _keeps_told(s, centers)]
    rivals = [s for s in likely if _is_rival(s, starts[0])]
    best = replace(starts[0], rival_scatter_mm=rivals[0].scatter_mm if rivals else None)
    others = {s.sides.tobytes(): s for s in reversed(likely) if s.sides.tobytes() != best.sides.tobytes()}
    return [best, *sorted(others.values(), key=badness)]


def _keeps_told(start: Start, centers: Centers) -> bool:
    """Return whether a guess has most spheres whose side is told on that side."""
    told = start.misfit_mm[~centers.open_side]
    return len(told) == 0 or float(np.median(told)) < _BESIDE_MM


def badness(start: Start) -> float:
    """Return a robust cost: captures beyond a few scatters count as lost, however far they are."""
    scale = max(start.scatter_mm, 0.05)
    cost = np.log1p((start.misfit_mm / (3 * scale)) ** 2) + np.log(scale)
    return float(start.shares @ cost)


def _is_rival(start: Start, best: Start) -> bool:
    """Return whether a guess has other sides that fit it: one whose other sides are its outliers is no rival."""
    differ = start.sides != best.sides
    return bool(differ.any()) and float(np.median(start.misfit_mm[differ])) < 3 * start.scatter_mm


def _candidates(centers: Centers) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return guesses (rotation, translation, center), the more likely ones first."""
    weight = np.ones_like(centers.measured)
    weight[:, 1] = np.where(centers.open_side, 0.0, centers.height_weight)
    sought = centers.sought(weight)
    shares = centers.shares
    rotations, linear, misfit = _searched(sought, shares)
    scatter = middle_of(sought.distances(misfit), shares)
    guesses: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    order = np.argsort(scatter)
    for index in order[apart(rotations[order], _KEPT)]:
        guesses += by_heights(centers, rotations[index], linear[index])
    return guesses


def by_heights(
    centers: Centers, rotation: FloatArray, linear: FloatArray
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return guesses (rotation, translation, center) of one rotation and its linear unknowns, one a height."""
    center, (x, y, z) = linear[:3], linear[3:]
    return [
        (rotation, rotation @ np.array([x, height, z]), center) for height in heights(centers, rotation, center, y)
    ]


def _searched(sought: Sought, shares: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rotations, linear unknowns and residuals of guesses from everywhere, by all captures and by few."""
    count = sought.measured.shape[1]
    rotations = random_rotations(_STARTS if count > _FEW else _STARTS + _STARTS_BY_FEW)
    found = [_promising(sought, shares, *sought.refined(rotations, sought.linear_unknowns(rotations), 8)[:2])]
    if count > _FEW:
        some = sought.chosen(random_few(_STARTS_BY_FEW, shares, _FEW))
        rotations = random_rotations(_STARTS_BY_FEW)
        rotations, linear, _ = some.refined(rotations, some.linear_unknowns(rotations), 12)
        found.append(_promising(sought, shares, rotations, linear))
    rotations, linear = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return rotations, linear, sought.misfit(rotations, linear)


def _promising(
    sought: Sought, shares: FloatArray, rotations: FloatArray, linear: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return those guesses refined to the end that fit best so far: a third of them."""
    scatter = middle_of(sought.distances(sought.misfit(rotations, linear)), shares)
    best = np.argsort(scatter)[: max(len(scatter) // 3, 1)]
    return sought.refined(rotations[best], linear[best], 17)[:2]


def heights(centers: Centers, rotation: FloatArray, center: FloatArray, given: float) -> list[float]:
    """Return values of the translation along L's y on which the captures' |y| agree best."""
    if not centers.open_side.any():
        return [given]
    arms = np.einsum("kji,kj->ki", centers.rotations, center - centers.translations) @ rotation[:, 1]
    height = centers.measured[:, 1]
    votes = np.concatenate([arms - height, arms + height])
    off = np.abs(np.abs(arms - votes[:, None]) - np.abs(height)) * centers.height_weight
    if not centers.open_side.all():
        fixed = ~centers.open_side
        off[:, fixed] = np.abs((arms - votes[:, None]) - height)[:, fixed]
    cost = np.sum(np.log1p((off / 1.0) ** 2), axis=1)
    chosen: list[float] = []
    for index in np.argsort(cost):
        if all(abs(votes[index] - other) > 2.0 for other in chosen):
            chosen.append(float(votes[index]))
        if len(chosen) == 3:
            break
    return chosen


def settled(centers: Centers, guesses: list[tuple[FloatArray, FloatArray, FloatArray]]) -> list[Start]:
    """Return guesses refined on all three components, the sides taken from where each guess puts the sphere."""
    height = np.broadcast_to(centers.height_weight[:, None] * [0.0, 1.0, 0.0], centers.measured.shape)
    sought = centers.sought(np.broadcast_to([1.0, 0.0, 1.0], height.shape) + height)
    rotations = np.array([rotation for rotation, _, _ in guesses])
    linear = np.array([np.concatenate([c, r.T @ t]) for r, t, c in guesses])
    signed = np.broadcast_to(centers.measured, (len(guesses), *centers.measured.shape)).copy()
    misfit = sought.misfit(rotations, linear)
    for _ in range(6):
        expected = (misfit + signed)[..., 1]
        other = np.where(centers.open_side, np.copysign(signed[..., 1], expected), signed[..., 1])
        changed = not np.array_equal(other, signed[..., 1])
        signed[..., 1] = other
        rotations, linear, misfit = replace(sought, measured=signed).refined(rotations, linear, 6)
        if not changed:
            break
    distance = sought.distances(misfit)
    sides = np.where(centers.open_side, np.where(signed[..., 1] < 0, -1, 1), 0)
    shares = centers.shares
    return [
        Start(r, r @ u[3:], u[:3], s, d, shares, float(m), None)
        for r, u, s, d, m in zip(rotations, linear, sides, distance, middle_of(distance, shares), strict=True)
    ]


def middle_of(distances: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the median of distances (N, K), each counting by its share (K,)."""
    if np.all(shares == 1):
        return np.median(distances, axis=1)
    order = np.argsort(distances, axis=1)
    below = np.cumsum(shares[order], axis=1)
    place = np.argmax(below >= below[:, -1:] / 2, axis=1)
    return np.take_along_axis(distances, np.take_along_axis(order, place[:, None], axis=1), axis=1)[:, 0]
