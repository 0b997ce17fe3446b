"""Errors that the answer has no room for: poses that lag along the robot's path.

Each is one unknown more, tried at the answer by a score test: how much likelier all captures get with it.  The
poses stay as they are; the answer is less sure by what such an error did to it, also before it is rare enough to
be said.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from calib_core.chain.noise import NoiseShapes
from calib_core.chain.rejection import Judged
from calib_core.chain.score import Scores, more_than_chance
from calib_core.findings import Finding
from calib_core.findings.codes import arm as codes
from calib_core.frames import FloatArray, vector_from_rotation

Kind = Literal["poses-lag", "poses-lag-share", "poses-lag-in-flange"]

RARE: Final = 0.001  # each of four, with `chain.bend`: about one right session in 250 is doubted
LEAST_MM: Final = 0.05
_FAR_MM: Final = 5.0
_FAR_SHARE: Final = 0.1
_LEAST_CAPTURES: Final = 10
_LEAST_WAY_MM: Final = 1.0
_DOUBTED: Final = 0.02  # from here on the answer is less sure


@dataclass(frozen=True, eq=False)
class Unmodelled:
    """One error: its size along the path, how rare so much is by chance, and what it did to the unknowns (P,).

    `share` is how much of the step's square is more than chance.
    """

    kind: Kind
    size_mm: float
    chance: float
    step: FloatArray
    share: float

    @property
    def said(self) -> bool:
        """Whether chance does not explain it and it is large enough to matter."""
        return self.chance < RARE and self.size_mm > LEAST_MM

    @property
    def spread(self) -> FloatArray:
        """By what the answer is less sure, a covariance (P, P)."""
        return (1.0 if self.said else self.share) * np.outer(self.step, self.step)

    @property
    def finding(self) -> Finding:
        """What is noticed of it."""
        return codes.POSES_LAG(lag_mm=self.size_mm)


def unmodelled_of(judged: Judged) -> Unmodelled | None:
    """Return the error that chance explains least, where that is rare enough to doubt the answer; else None."""
    if not can_show(judged):
        return None
    found = [one for one in _lags(judged, Scores.of(judged)) if one.chance < _DOUBTED]
    return min(found, key=lambda one: (not one.said, one.chance), default=None)


def can_show(judged: Judged, scanner: int | None = None) -> bool:
    """Return whether captures, all or those of one scanner, are enough to show one unknown more."""
    own = judged.used if scanner is None else judged.used & (judged.data.walk.scanner == scanner)
    return int(own.sum()) >= _LEAST_CAPTURES


def _lags(judged: Judged, scores: Scores) -> Iterator[Unmodelled]:
    """Yield poses that are reported by a length, or by a share of the last move, ahead of where the robot is.

    Or by a length that the flange shows along one of its axes alone, as play in a wrist does.
    """
    data, state = judged.data, judged.fit.state
    walk = data.walk
    if walk.layout.axes or not walk.over_robot.all():
        return
    centers = judged.fit.minimum.at.centers_in_laser
    middle = walk.translations.mean(axis=0)
    moves = NoiseShapes.at(data, centers, state, None, middle).moves
    rotations, places = walk.poses
    way = np.diff(places, axis=0, prepend=places[:1])
    turn = np.zeros_like(way)
    for k in range(1, len(way)):
        turn[k] = vector_from_rotation(rotations[k] @ rotations[k - 1].T)
    for k in np.flatnonzero((np.diff(data.stop, prepend=-1) == 0) & (data.stop >= 0)):
        way[k], turn[k] = way[k - 1], turn[k - 1]  # the robot came to a stop but once
    length = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(length, _LEAST_WAY_MM)[:, None]
    usual_mm = float(np.median(length[1:]))
    trials: tuple[tuple[Kind, FloatArray, float], ...] = (
        ("poses-lag", np.hstack([unit, np.zeros_like(unit)]), _FAR_MM),
        ("poses-lag-share", np.hstack([way, -turn]), _FAR_SHARE),
    )
    axes = np.moveaxis(rotations, 2, 0)
    across = [np.einsum("ki,ki->k", unit, axis)[:, None] * axis for axis in axes]
    in_flange: list[tuple[Kind, FloatArray, float]] = [
        ("poses-lag-in-flange", np.hstack([shift, np.zeros_like(shift)]), _FAR_MM) for shift in across
    ]
    for kind, shift, far in (*trials, *in_flange):
        rows = np.einsum("kij,kj->ki", moves, shift)[:, :, None]
        gain, size, step = scores.gained(rows, far)
        size_mm = abs(float(size[0])) * (usual_mm if kind == "poses-lag-share" else 1.0)
        chance = min(1.0, scores.chance(gain, 1) * (len(axes) if kind == "poses-lag-in-flange" else 1))
        yield Unmodelled(kind, size_mm, chance, step[: data.width], more_than_chance(gain, 1))
