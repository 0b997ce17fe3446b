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
_AGREE = 0.3  # of the distance of captures that all lie off alike
_SAME_TOOL = 0.15  # of that distance, what another tool leaves
_FITS_BETTER = 3.0  # by how much more another place leaves
_LEAST_LEFT = 0.02  # of the misfit: what a linear step says of less is rounding


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
    if at_end := _changed_at_an_end(observations, judged, rejected, offset_in_base_mm):
        return [at_end]
    change = _change(observations, judged)
    if change and any(given):
        # Told sigmas that are too small make chance look like a change: it must stand when they are estimated too.
        doubted = judge_these(
            observations, judged.data, judged.fit.state, judged.used, (None,) * len(given), judged.fit
        )
        change = _change(observations, doubted)
    return [change] if change else []


def _changed_at_an_end(
    observations: Observations, judged: Judged, rejected: np.ndarray, offset_in_base_mm: FloatArray
) -> Happened | None:
    """Return what changed where the rejected captures are the last or first and agree on a place or a tool."""
    names = [o.capture for o in observations]
    at_end = len(rejected) > 0 and rejected[-1] == len(names) - 1
    if len(rejected) < _LEAST_AFTER or np.any(np.diff(rejected) != 1) or not (at_end or rejected[0] == 0):
        return None
    since = int(rejected[0]) if at_end else int(rejected[-1]) + 1
    offsets = offset_in_base_mm[rejected]
    mean = offsets.mean(axis=0)
    distance = float(np.linalg.norm(mean))
    tool = _tool_of(observations, judged, rejected, offsets)
    if tool is not None:
        return _changed(names, since, tool)
    if distance == 0 or np.linalg.norm(offsets - mean, axis=1).max() > _AGREE * distance:
        return None
    when, capture = ("before", names[since]) if at_end else ("after", names[since - 1])
    return _moved(names, since, distance, when, capture)


def _tool_of(
    observations: Observations, judged: Judged, some: np.ndarray, offsets: FloatArray
) -> FloatArray | None:
    """Return how the scanner sits otherwise in captures (6), where that explains far better than another place."""
    freedom = offsets.size - np.array([3, 6])
    if freedom[1] <= 0:
        return None
    turned = np.array([observations[k].base_from_tool0.rotation for k in some]) @ judged.fit.state.tool_rotation
    off = np.einsum("kji,kj->ki", turned, offsets).ravel()
    left: list[float] = []
    step = np.zeros(6)
    for rows in (by_place(judged), by_mount(judged)):
        matrix = rows[some].reshape(len(off), -1)
        step = np.linalg.lstsq(matrix, off, rcond=None)[0]
        left.append(float(np.linalg.norm(off - matrix @ step)))
    by_place_mm, by_tool_mm = np.array(left) / np.sqrt(freedom)
    known = by_tool_mm < _SAME_TOOL * np.linalg.norm(off) / np.sqrt(len(off))
    return step if known and _FITS_BETTER * by_tool_mm < by_place_mm else None


def _moved(names: Sequence[str], since: int, distance_mm: float, when: str, capture: str) -> Happened:
    values: dict[str, Any] = {"shift_mm": distance_mm, "when": when, "capture": capture, "since": names[since]}
    return Happened(codes.MOVED_SPHERE, tuple(names[since:]), values)


def _changed(names: Sequence[str], since: int, step: FloatArray) -> Happened:
    turn_deg, shift_mm = float(np.rad2deg(np.linalg.norm(step[:3]))), float(np.linalg.norm(step[3:]))
    values: dict[str, Any] = {"since": names[since], "shift_mm": shift_mm, "turn_deg": turn_deg}
    return Happened(codes.CHANGED_TOOL, tuple(names[since:]), values)


def _change(observations: Observations, judged: Judged) -> Happened | None:
    """Return the likeliest change of sphere or tool within the session, where one is clear and large."""
    gains, sizes = change_scores(judged)
    misfit = _misfit(judged)
    freedom = 3 * int(judged.used.sum()) - judged.data.free_unknowns
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
        told = float(gain[k])
        if None in judged.given[:2]:  # the change made the estimated sigmas large: without it they are small
            left = max(misfit - float(gains[kind][k]), _LEAST_LEFT * misfit)
            told = freedom * float(np.log(misfit / left)) - unknowns
        if best is not None and told < best[0] + _BY_CHANCE:
            continue
        moved = kind == "moved-sphere"
        best = told, _moved(names, k, shift_mm, "before", names[k]) if moved else _changed(names, k, size)
    return best[1] if best else None


def _misfit(judged: Judged) -> float:
    """Return the captures' squared distances from the sphere, in standard deviations, together."""
    reduced, rest = _left(judged.fit.minimum.at)
    informations = reduced[:, :3, :3]
    return float(np.einsum("ki,kij,kj->", rest, np.linalg.pinv(informations), rest))


def _left(at: ChainLinearisation) -> tuple[FloatArray, FloatArray]:
    """Return what each capture knows of its centre and the nuisances, and the slope (K, 3) by its centre."""
    reduced, rest = without_pose_errors(at.information, at.vector, at.gain, at.share)
    return reduced, (rest - np.einsum("kij,kj->ki", reduced[:, :, :3], at.offset))[:, :3]


def change_scores(judged: Judged) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return, for each kind and for a change before each capture, twice the log-likelihood gained and its size."""
    at = judged.fit.minimum.at
    reduced, rest = _left(at)
    covariance = covariance_of(at.hessian)
    gains: dict[str, FloatArray] = {}
    sizes: dict[str, FloatArray] = {}
    count = len(rest)
    for kind, own in (("moved-sphere", by_place(judged)), ("changed-tool", by_mount(judged))):
        width = own.shape[2]
        turned = np.swapaxes(own, 1, 2)
        scores = np.einsum("kpi,ki->kp", turned, rest)
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
