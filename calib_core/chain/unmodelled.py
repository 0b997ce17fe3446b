"""Errors that the answer has no room for: a bent sheet of light, poses that lag along the robot's path.

Each is one unknown more, tried at the answer by a score test: how much likelier all captures get with it.  The
sheet's bend moves points across the plane of light; how the likelihood follows it is found by differences, all
captures' own centres settled anew.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from calib_core.chain.likelihood import NoiseShapes, linearised_at
from calib_core.chain.model import ChainData
from calib_core.chain.rejection import Judged
from calib_core.chain.score import Scores
from calib_core.estimation import covariance_of
from calib_core.findings import Finding
from calib_core.findings.codes import arm as arm_codes
from calib_core.findings.codes import tcp as codes
from calib_core.frames import FloatArray, vector_from_rotation

Kind = Literal["sheet-bent", "poses-lag", "poses-lag-share"]

_RARE: Final = 0.001  # each of three: about one right session in 300 is doubted
_FAR_MM: Final = 5.0
_FAR_SHARE: Final = 0.1
_LEAST_MM: Final = 0.05
_TRIED_MM: Final = 0.05  # at the stripe's ends
_LEAST_CAPTURES: Final = 10
_LEAST_WAY_MM: Final = 1.0


@dataclass(frozen=True)
class Unmodelled:
    """One error: its size at the stripe's ends, or along the path, and how rare so much is by chance."""

    kind: Kind
    size_mm: float
    chance: float
    half_width_mm: float

    @property
    def finding(self) -> Finding:
        """What is noticed of it."""
        if self.kind == "sheet-bent":
            return codes.SHEET_BENT(bend_mm=self.size_mm, half_width_mm=self.half_width_mm)
        return arm_codes.POSES_LAG(lag_mm=self.size_mm)


def unmodelled_of(judged: Judged) -> Unmodelled | None:
    """Return the likeliest error that chance does not explain and that is large enough to matter, or None."""
    data = judged.data
    if np.count_nonzero(judged.used) < _LEAST_CAPTURES or len(data.walk.layout.mounts) > 1:
        return None
    scores = Scores.of(judged)
    tried = [*_lags(judged, scores), *_bend(judged, scores)]
    found = [one for one in tried if one.chance < _RARE and one.size_mm > _LEAST_MM]
    return min(found, key=lambda one: one.chance, default=None)


def _lags(judged: Judged, scores: Scores) -> Iterator[Unmodelled]:
    """Yield poses that are reported by a length, or by a share of the last move, ahead of where the robot is."""
    data, state = judged.data, judged.fit.state
    walk = data.walk
    if walk.layout.axes or not np.all(walk.over_robot == 1):
        return
    centers = judged.fit.minimum.at.centers_in_laser
    middle = walk.translations.mean(axis=0)
    moves = NoiseShapes.at(data, centers, state, None, middle).moves
    rotations, places = walk.poses
    way = np.diff(places, axis=0, prepend=places[:1])
    turn = np.zeros_like(way)
    for k in range(1, len(way)):
        turn[k] = vector_from_rotation(rotations[k] @ rotations[k - 1].T)
    length = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(length, _LEAST_WAY_MM)[:, None]
    usual_mm = float(np.median(length[1:]))
    trials: tuple[tuple[Kind, FloatArray, float], ...] = (
        ("poses-lag", np.hstack([unit, np.zeros_like(unit)]), _FAR_MM),
        ("poses-lag-share", np.hstack([way, -turn]), _FAR_SHARE),
    )
    for kind, shift, far in trials:
        rows = np.einsum("kij,kj->ki", moves, shift)[:, :, None]
        gain, size = scores.gained(rows, far)
        size_mm = abs(float(size[0])) * (1.0 if kind == "poses-lag" else usual_mm)
        yield Unmodelled(kind, size_mm, scores.chance(gain, 1), data.half_width_mm)


def _bend(judged: Judged, scores: Scores) -> Iterator[Unmodelled]:
    """Yield a sheet of light that is bent: points lie off its plane by the square of x."""
    data = judged.data
    if not len(data.points):
        return
    here = linearised_at(data, judged.fit.state, judged.fit.sigmas)
    one, other = (
        linearised_at(_bent(data, bend_mm), judged.fit.state, judged.fit.sigmas)
        for bend_mm in (_TRIED_MM, -_TRIED_MM)
    )
    slope = (one.cost - other.cost) / (2 * _TRIED_MM)
    curvature = (one.cost + other.cost - 2 * here.cost) / _TRIED_MM**2
    cross = (one.gradient - other.gradient) / (2 * _TRIED_MM)
    inverse = covariance_of(here.hessian)
    # What the answer leaves of its own slope is taken out.
    slope -= float(cross @ inverse @ here.gradient)
    information = curvature - float(cross @ inverse @ cross) + 1 / _FAR_MM**2
    if information <= 0:
        return
    gain, size_mm = slope**2 / information, -slope / information
    yield Unmodelled("sheet-bent", abs(size_mm), scores.chance(gain, 1), data.half_width_mm)


def _bent(data: ChainData, bend_mm: float) -> ChainData:
    points: FloatArray = data.points.copy()
    points[:, 1] += bend_mm * (data.points[:, 0] / data.half_width_mm) ** 2
    return replace(data, points=points)
