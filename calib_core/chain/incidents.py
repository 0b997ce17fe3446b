"""What happened to the captures, where one cause explains several of them: a moved sphere, a changed tool, a swap.

A change at some capture adds unknowns that only the captures from there on feel: three for a sphere that was
moved, six for a tool that was changed.  How much likelier all captures get with them follows from the normal
equations at the answer (a score test), for every place of the change at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from calib_core.chain.leave_one_out import without_each
from calib_core.chain.likelihood import ChainLinearisation, without_pose_errors
from calib_core.chain.observations import Observations, SphereObservation
from calib_core.chain.rejection import Judged, judge_these
from calib_core.chain.variance import GivenSigmas
from calib_core.estimation import covariance_of
from calib_core.findings import Code
from calib_core.findings.codes import causes as codes
from calib_core.frames import FloatArray

_LEAST_AFTER = 3
_FAR_MM, _FAR_RAD = (
    5.0,
    0.05,
)  # how far a sphere or a scanner is moved by mishap: larger moves are told by rejection
_BY_CHANCE = 8.0  # beyond the mean of χ² of so many unknowns, over all places of a change
_LEAST_SHIFT_MM = 0.4
_LEAST_TURN_RAD = np.deg2rad(0.05)
_SWAP_CLOSER = 25.0  # in squared standard deviations
_MOST_SWAPS = 8


@dataclass(frozen=True)
class Happened:
    """One cause: its code, the captures that it is about, and what its texts say."""

    code: Code
    captures: tuple[str, ...]
    values: Mapping[str, Any]

    @property
    def kind(self) -> str:
        """Which cause it is, as its remedy names it."""
        return self.code.name


def named_causes(
    observations: Observations, judged: Judged, offset_in_base_mm: FloatArray, given: GivenSigmas = (None, None)
) -> list[Happened]:
    """Return the causes that are beyond doubt.

    Parameters
    ----------
    observations : K captures, in the order in which they were taken
    judged : Judged
    offset_in_base_mm : (K, 3)
        Each capture's own sphere centre minus the solved one.
    given : GivenSigmas
        What is told of the robot.
    """
    swapped = _swapped(observations, judged)
    if swapped:
        return swapped
    rejected = np.flatnonzero(~judged.used)
    moved = _moved_at_an_end(observations, rejected, offset_in_base_mm)
    if moved:
        return [moved]
    change = _change(observations, judged)
    if change and any(given):
        # Told sigmas that are too small make chance look like a change: it must stand when they are estimated too.
        doubted = judge_these(
            observations, judged.data, judged.fit.state, judged.used, (None,) * len(given), judged.fit
        )
        change = _change(observations, doubted)
    return [change] if change else []


def _moved_at_an_end(
    observations: Observations, rejected: np.ndarray, offset_in_base_mm: FloatArray
) -> Happened | None:
    """Return the moved sphere where the rejected captures are the last or first ones and agree on a new place."""
    if len(rejected) < _LEAST_AFTER or np.any(np.diff(rejected) != 1):
        return None
    offsets = offset_in_base_mm[rejected]
    mean = offsets.mean(axis=0)
    distance = float(np.linalg.norm(mean))
    if distance == 0 or np.linalg.norm(offsets - mean, axis=1).max() > 0.3 * distance:
        return None
    names = [o.capture for o in observations]
    if rejected[-1] == len(names) - 1:
        return _moved(names, int(rejected[0]), distance, "before", names[rejected[0]])
    if rejected[0] == 0:
        return _moved(names, int(rejected[-1]) + 1, distance, "after", names[rejected[-1]])
    return None


def _moved(names: Sequence[str], since: int, distance_mm: float, when: str, capture: str) -> Happened:
    values: dict[str, Any] = {"shift_mm": distance_mm, "when": when, "capture": capture, "since": names[since]}
    return Happened(codes.MOVED_SPHERE, tuple(names[since:]), values)


def _change(observations: Observations, judged: Judged) -> Happened | None:
    """Return the likeliest change of sphere or tool within the session, where one is clear and large."""
    gains, sizes = change_scores(judged)
    names = [o.capture for o in observations]
    best: tuple[float, Happened] | None = None
    for kind, unknowns in (("moved-sphere", 3), ("changed-tool", 6)):
        gain = gains[kind] - unknowns
        k = int(np.argmax(gain))
        size = sizes[kind][k]
        limit = 2 * _BY_CHANCE + 2 * np.log(len(names))
        shift_mm, turn_rad = float(np.linalg.norm(size[-3:])), float(np.linalg.norm(size[:-3]))
        if gain[k] < limit or (shift_mm < _LEAST_SHIFT_MM and turn_rad < _LEAST_TURN_RAD):
            continue
        if best is not None and gain[k] < best[0] + _BY_CHANCE:
            continue
        if kind == "moved-sphere":
            cause = _moved(names, k, shift_mm, "before", names[k])
        else:
            turn_deg = float(np.rad2deg(turn_rad))
            values: dict[str, Any] = {"since": names[k], "shift_mm": shift_mm, "turn_deg": turn_deg}
            cause = Happened(codes.CHANGED_TOOL, tuple(names[k:]), values)
        best = float(gain[k]), cause
    return best[1] if best else None


def change_scores(judged: Judged) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return, for each kind and for a change before each capture, twice the log-likelihood gained and its size."""
    at = judged.fit.minimum.at
    reduced, rest = without_pose_errors(at.information, at.vector, at.gain, at.share)
    rest = rest - np.einsum("kij,kj->ki", reduced[:, :, :3], at.offset)
    covariance = covariance_of(at.hessian)
    gains: dict[str, FloatArray] = {}
    sizes: dict[str, FloatArray] = {}
    count = len(rest)
    for kind, own in (("moved-sphere", by_place(judged)), ("changed-tool", by_mount(judged))):
        width = own.shape[2]
        turned = np.swapaxes(own, 1, 2)
        scores = np.einsum("kpi,ki->kp", turned, rest[:, :3])
        squares = turned @ reduced[:, :3, :3] @ own
        crosses = turned @ _by_all(reduced, at)
        # Sums over the captures from each one on.
        score, square, cross = (np.cumsum(a[::-1], axis=0)[::-1] for a in (scores, squares, crosses))
        believed = np.diag([1 / _FAR_MM**2] * 3 if width == 3 else [1 / _FAR_RAD**2] * 3 + [1 / _FAR_MM**2] * 3)
        information = square - cross @ covariance @ np.swapaxes(cross, 1, 2) + believed
        gain, size = np.zeros(count), np.zeros((count, width))
        enough = np.arange(_LEAST_AFTER, count - _LEAST_AFTER)
        for k in enough:
            size[k] = np.linalg.solve(information[k], score[k])
            gain[k] = float(score[k] @ size[k])
        gains[kind], sizes[kind] = gain, size
    return gains, sizes


def by_mount(judged: Judged) -> FloatArray:
    """Return how each capture's sphere is expected elsewhere by its own scanner's mount, (K, 3, 6)."""
    at, walk = judged.fit.minimum.at, judged.data.walk
    first = np.array([walk.layout.mount(n).start for n in range(len(walk.layout.mounts))])[walk.scanner]
    return np.take_along_axis(at.jacobian, (first[:, None] + np.arange(6))[:, None, :], axis=2)


def by_place(judged: Judged) -> FloatArray:
    """Return how each capture's sphere is expected elsewhere by its own place, (K, 3, 3)."""
    at, walk = judged.fit.minimum.at, judged.data.walk
    first = walk.layout.firsts[walk.place]
    return np.take_along_axis(at.jacobian, (first[:, None] + np.arange(3))[:, None, :], axis=2)


def _by_all(reduced: FloatArray, at: ChainLinearisation) -> FloatArray:
    """Return Λ's rows of the centre times the rows of all unknowns, (K, 3, P)."""
    product = reduced[:, :3, :3] @ at.jacobian
    product[:, :, at.nuisances] += reduced[:, :3, 3:]
    return product


def _swapped(observations: Observations, judged: Judged) -> list[Happened]:
    """Return pairs of rejected captures that both fit with each other's pose."""
    rejected = np.flatnonzero(~judged.used)
    if not 2 <= len(rejected) <= _MOST_SWAPS:
        return []
    without = without_each(judged.fit.minimum.at)
    found: list[Happened] = []
    taken: set[int] = set()
    for i, j in combinations(rejected.tolist(), 2):
        if {i, j} & taken:
            continue
        squares = [_with_pose_of(observations[a], b, judged, without.spread[b]) for a, b in ((i, j), (j, i))]
        if all(
            s < min(_SWAP_CLOSER, judged.squared_distance[k] / 4) for s, k in zip(squares, (i, j), strict=True)
        ):
            taken |= {i, j}
            names = observations[i].capture, observations[j].capture
            values: dict[str, Any] = {"first": names[0], "second": names[1], "how": "two-rejected"}
            found.append(Happened(codes.SWAPPED_POSES, names, values))
    return found


def _with_pose_of(o: SphereObservation, other: int, judged: Judged, spread: FloatArray) -> float:
    """Return a capture's squared distance from the sphere, had it been taken in another one's pose."""
    at, state = judged.fit.minimum.at, judged.fit.state
    expected = at.centers_in_laser[other] + at.offset[other]
    covariance = np.linalg.inv(at.precision[other]) + spread
    covariance = covariance + o.center_covariance[:3, :3] * o.points_per_independent
    measured = o.center_in_laser_mm
    if o.circle_radius_mm is None:
        off = measured - expected
        return float(off @ np.linalg.solve(covariance, off))
    height = np.sqrt(max(state.radius_mm**2 - o.circle_radius_mm**2, 0.0))
    off = np.array([*(measured - expected)[[0, 2]], abs(expected[1]) - height])
    slack = np.diag(
        [0.0, 0.0, (1e-3 * state.radius_mm * o.circle_radius_mm / max(height, 0.05 * state.radius_mm)) ** 2]
    )
    some = [0, 2, 1]
    return float(off @ np.linalg.solve(covariance[np.ix_(some, some)] + slack, off))
