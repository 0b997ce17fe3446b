"""Hypotheses on a still sphere's captures tried all at once: how well they fit with other poses than the recorded.

A hypothesis gives every capture a pose.  A coarse search over tool and sphere takes all hypotheses together, in
arrays, and leaves out y, whose sign a profile does not tell; the best few are then settled on all components.
All are judged with one scale, so that a hypothesis does not win by fitting most captures well and losing the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.guesses import Sought, apart, random_rotations
from calib_core.chain.start import Centers, Start, badness, by_heights, settled
from calib_core.frames import FloatArray, RigidTransform

_STARTS = 72
MUCH_CLOSER = 0.5
"""Of the scatter that captures have as they are told, what they have once a mistake is taken back, at most."""

_FEW = 24  # captures that the coarse search looks at
_COARSE_STEPS, _FINE_STEPS = 8, 14
_KEPT_PER_HYPOTHESIS = 3
_GUESSES_AT_ONCE = 8000
_LEAST_SCALE_MM = 0.05


@dataclass(frozen=True, eq=False)
class Posed:
    """A hypothesis: for each of K captures a pose, from what carries its scanner into what carries its ball.

    `known` (K,) is false where it has none.
    """

    poses: Sequence[RigidTransform]
    known: np.ndarray

    def centers(self, centers: Centers) -> Centers:
        """Return the captures with these poses; those without one have no weight in a search."""
        return replace(
            centers,
            rotations=np.array([pose.rotation for pose in self.poses]),
            translations=np.array([pose.translation_mm for pose in self.poses]),
        )


def best_starts(
    centers: Centers, hypotheses: Sequence[Posed], most: int, near: FloatArray | None = None
) -> dict[int, Start]:
    """Return the best start of the likeliest hypotheses, by their places; that of the first is always there.

    Parameters
    ----------
    centers : Centers
        K captures; their poses are not looked at.
    hypotheses : sequence of Posed
    most : int
        How many are settled.
    near : (N, 3, 3), optional
        Rotations of the scanner from which to search; left out, from everywhere.
    """
    coarse = _coarse(centers, hypotheses, random_rotations(_STARTS) if near is None else near)
    order = sorted(range(len(hypotheses)), key=lambda h: coarse[h][0])[:most]
    return {h: started(hypotheses[h], centers, coarse[h][1]) for h in dict.fromkeys([0, *order])}


def cost_of(misfit_mm: FloatArray, scale_mm: float) -> FloatArray:
    """Return how badly captures lie off; far beyond a few scales it grows slowly."""
    return np.log1p((misfit_mm / (3 * max(scale_mm, _LEAST_SCALE_MM))) ** 2)


def _coarse(
    centers: Centers, hypotheses: Sequence[Posed], starts: FloatArray
) -> list[tuple[float, list[FloatArray]]]:
    """Return for each hypothesis the robust scatter in x and z of its best guess, and its best rotations."""
    found: list[tuple[float, list[FloatArray]]] = []
    at_once = max(_GUESSES_AT_ONCE // len(starts), 1)
    for first in range(0, len(hypotheses), at_once):
        found += _coarse_of_some(centers, hypotheses[first : first + at_once], starts)
    return found


def _coarse_of_some(
    centers: Centers, hypotheses: Sequence[Posed], each_from: FloatArray
) -> list[tuple[float, list[FloatArray]]]:
    count = len(centers.measured)
    some = np.unique(np.linspace(0, count - 1, min(count, _FEW)).astype(int))
    weight = np.ones((len(some), 3))
    weight[:, 1] = np.where(centers.open_side, 0.0, centers.height_weight)[some]
    rotations = np.array([[h.poses[k].rotation for k in some] for h in hypotheses])
    translations = np.array([[h.poses[k].translation_mm for k in some] for h in hypotheses])
    known = np.array([h.known[some] for h in hypotheses])
    count_of_starts = len(each_from)
    each = np.repeat(np.arange(len(hypotheses)), count_of_starts)
    starts = np.tile(each_from, (len(hypotheses), 1, 1))
    weights = weight * known[:, :, None]

    def sought(which: np.ndarray) -> Sought:
        return Sought(rotations[which], translations[which], centers.measured[None, some], weights[which])

    guessed = sought(each)
    turned, linear, misfit = guessed.refined(starts, guessed.linear_unknowns(starts), _COARSE_STEPS)
    scatter = _scatter(guessed, misfit, known[each])
    best = np.concatenate([
        h * count_of_starts
        + np.argsort(scatter[h * count_of_starts : (h + 1) * count_of_starts])[: max(count_of_starts // 4, 2)]
        for h in range(len(hypotheses))
    ])  # fmt: skip
    again = sought(each[best])
    turned, linear, misfit = again.refined(turned[best], linear[best], _FINE_STEPS)
    scatter = _scatter(again, misfit, known[each[best]])
    found: list[tuple[float, list[FloatArray]]] = []
    for h in range(len(hypotheses)):
        own = np.flatnonzero(each[best] == h)
        order = own[np.argsort(scatter[own])]
        found.append((float(scatter[order[0]]), list(turned[order[apart(turned[order], _KEPT_PER_HYPOTHESIS)]])))
    return found


def _scatter(sought: Sought, misfit: FloatArray, known: np.ndarray) -> FloatArray:
    """Return a quantile (N,) of the known captures' distances, beyond the median: a few always fit by chance."""
    distances = np.sort(np.where(known, sought.distances(misfit), np.nan), axis=1)  # what is not known stands last
    at = 0.6 * np.maximum(np.count_nonzero(~np.isnan(distances), axis=1) - 1, 0)[:, None]
    below = at.astype(int)
    near, far = (np.take_along_axis(distances, place, axis=1) for place in (below, np.ceil(at).astype(int)))
    return (near + (at - below) * (far - near))[:, 0]


def started(hypothesis: Posed, centers: Centers, rotations: Sequence[FloatArray]) -> Start:
    """Return the best guess from these rotations, settled on all components of the captures that have a pose."""
    posed = hypothesis.centers(centers)
    own = posed.chosen(hypothesis.known)
    weight = np.ones_like(own.measured)
    weight[:, 1] = np.where(own.open_side, 0.0, own.height_weight)
    guesses: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for rotation in rotations:
        linear = own.sought(weight).linear_unknowns(rotation[None])[0]
        guesses += by_heights(own, rotation, linear)
    return min(settled(own, guesses), key=badness)


def resettled(hypothesis: Posed, centers: Centers, start: Start) -> Start:
    """Return the best guess near one that was settled with other poses."""
    return started(hypothesis, centers, [start.rotation])


def misfits_mm(centers: Centers, start: Start) -> FloatArray:
    """Return how far each capture (rows) lies off at each capture's pose (columns), (K, K), on its better side."""
    arms = np.einsum("kji,kj->ki", centers.rotations, start.center - centers.translations)
    expected = (arms - start.translation) @ start.rotation
    off = centers.measured[:, None, :] - expected[None, :, :]
    mirrored = np.abs(np.abs(centers.measured[:, None, 1]) - np.abs(expected[None, :, 1]))
    height = (
        np.where(centers.open_side[:, None], mirrored, np.abs(off[..., 1]))
        * np.sqrt(centers.height_weight)[:, None]
    )
    return np.sqrt(off[..., 0] ** 2 + height**2 + off[..., 2] ** 2)
