"""Where the nominal part lies among the merged points: by a robust best fit.

A start is sought where the part does not lie near already: turns all over, each drawn near by a few steps on a
handful of points with their normals.  The fit itself goes by the points' distances along the nominal's normals and
leaves out what is not of the part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray, rotation_from_vector, skew
from calib_core.fusion.deviation import Nominal
from calib_core.messages import message

SingleArray = NDArray[np.float32]

_FINE, _FEW = 20_000, 1500  # points that the fit goes by, and that starts are compared by
_SPREAD = 1200  # points on the nominal that a start is sought on
_LOOKS = ((120, 5, 16), (300, 15, 6))  # points, steps, and starts kept, one look after the other
_TURN_WEIGHT = 0.25  # how far a normal turned by a radian is off, of the nominal's size
_PLACED, _PLACED_SHARE = 0.004, 0.9  # of its size: so many points so near say that it lies there already
_FIRST_STEPS, _FINE_STEPS, _SLOWLY = 12, 45, 0.75
_TUKEY = 4.685
_ALIKE, _FACES = 1.15, 0.3  # poses that fit as well; cosine of a point's normal and the nominal's
_TURNED_RAD = 0.1
_CELLS = 8  # along the nominal's size: distances within one are counted as alike
_FEWEST_FREE = 4
_LEAST_MM = 1e-4
_SINGLE = 3e-6  # of the nominal's size: what single precision leaves
_FEWEST = 20


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where the nominal lies in the cloud.

    Parameters
    ----------
    cloud_from_reference : (4, 4)
    rms_mm : float
        Of the distances that it goes by.
    covariance : (6, 6)
        Of the fit alone: rx ry rz tx ty tz, the rotation on the right, the translation added in the cloud's frame.
    share : float
        Of the points that are of the part.
    alike : int
        Other poses that fit as well.
    """

    cloud_from_reference: FloatArray
    rms_mm: float
    covariance: FloatArray
    share: float = 1.0
    alike: int = 0


def best_fit(points_mm: FloatArray, normals: FloatArray, nominal: Nominal, least_mm: float = 0.0) -> Alignment:
    """Return where the nominal fits the points best, points of other things left out.

    Parameters
    ----------
    points_mm, normals : (N, 3)
        Of the merged cloud.
    nominal : Nominal
    least_mm : float
        Distances that are no difference: of poses that fit as well, the one nearest to the part as it lies counts.

    Raises
    ------
    MeasurementError
        If no pose brings the greater part of the points onto the nominal.
    """
    rng = np.random.default_rng(0)
    good = np.flatnonzero(np.isfinite(normals).all(axis=1))
    if len(good) < 2 * _FEWEST:
        raise MeasurementError("points with normals", f"{len(good)}", "Merge more scans.", "reference")
    chosen = rng.permutation(good)[:_FINE]
    points, facing = points_mm[chosen].astype(float), normals[chosen].astype(float)
    few = points[:_FEW], facing[:_FEW]
    placed = _fitted(*few, nominal, np.eye(4))
    found = [placed] if placed is not None and _share_near(points, nominal, placed) >= _PLACED_SHARE else []
    if not found:
        beside = _pose(np.eye(3), points.mean(axis=0) - nominal.spread(_SPREAD)[0].mean(axis=0))
        starts = [np.eye(4), beside, *_starts(points, facing, nominal)]
        drawn = (_fitted(*few, nominal, start) for start in starts)
        found = [one for one in drawn if one is not None and one.share > 0.5]
    if not found:
        to_do = message("Check that the reference is of this part and in millimetres, or tell where it lies.")
        raise MeasurementError("points that lie on the reference", "none that do in any pose", to_do, "reference")
    costs = [_cost(points, nominal, one) for one in found]
    best = min(costs)
    alike = [one for one, cost in zip(found, costs, strict=True) if cost <= _ALIKE * best + least_mm**2]
    nearest = min(alike, key=lambda one: _turn_rad(one.cloud_from_reference))
    fine = _fitted(points, facing, nominal, nearest.cloud_from_reference, 3 * nearest.rms_mm) or nearest
    return replace(fine, alike=_others(nearest, alike, nominal))


def rows_of(points: FloatArray, normals: FloatArray, pose: FloatArray, centre: FloatArray) -> FloatArray:
    """Return how a small change of the pose about a centre lessens distances, (N, 6)."""
    return np.concatenate([np.cross(points - centre, normals), normals @ pose[:3, :3].T], axis=1)


def stepped(pose: FloatArray, step: FloatArray, centre: FloatArray) -> FloatArray:
    """Return a pose after a small turn about a centre and a shift."""
    turn = rotation_from_vector(step[:3])
    new = pose.copy()
    new[:3, :3] = pose[:3, :3] @ turn
    new[:3, 3] = pose[:3, 3] + pose[:3, :3] @ (centre - turn @ centre) + step[3:]
    return new


def facing_alike(cosines: FloatArray) -> NDArray[np.bool_]:
    """Return which normals face as the nominal's do, by the cosines between them."""
    return cosines > _FACES


def about_origin(covariance: FloatArray, pose: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the covariance of a change about the reference's origin, out of that of one about a centre."""
    change = np.eye(6)
    change[3:, :3] = pose[:3, :3] @ skew(centre)
    return change @ covariance @ change.T


def _fitted(
    points: FloatArray, facing: FloatArray, nominal: Nominal, start: FloatArray, near_mm: float | None = None
) -> Alignment | None:
    """Return the pose that a start leads to, None where hardly a point is near; `near_mm` is how near it is."""
    pose, centre = start.copy(), nominal.middle_mm
    scale, number = near_mm or 0.05 * nominal.extent_mm, 0 if near_mm is None else _FIRST_STEPS
    while True:
        there = (points - pose[:3, 3]) @ pose[:3, :3]
        away, across = nominal.away(there)
        of_it = facing_alike(np.einsum("ij,ij->i", facing @ pose[:3, :3], across))
        distance = np.einsum("ij,ij->i", away, across)
        if number < _FIRST_STEPS:  # what lies beyond a border draws the nominal there
            far = np.linalg.norm(away, axis=1)
            across = np.where(far[:, None] > _LEAST_MM, away / np.maximum(far, _LEAST_MM)[:, None], across)
            distance = np.where(far > _LEAST_MM, far, distance)
        else:
            beside = np.linalg.norm(away - distance[:, None] * across, axis=1)
            of_it &= beside <= 0.5 * np.abs(distance) + _LEAST_MM * nominal.extent_mm
        near = of_it & (np.abs(distance) < _TUKEY * scale)
        if np.count_nonzero(near) < _FEWEST:
            return None
        spread = 1.4826 * float(np.median(np.abs(distance[near])))
        scale = max(min(spread, scale), _LEAST_MM) if number >= _FIRST_STEPS else max(_SLOWLY * scale, spread)
        bounded = np.where(near, np.maximum(1 - (distance / (_TUKEY * scale)) ** 2, 0.0), 0.0)
        weights = bounded**2
        rows = rows_of(there - away, across, pose, centre)
        matrix = (rows * weights[:, None]).T @ rows
        matrix += 1e-9 * np.diag([nominal.extent_mm**2] * 3 + [1.0] * 3) * weights.sum()
        step = np.linalg.solve(matrix, rows.T @ (weights * distance))
        pose = stepped(pose, step, centre)
        moved = max(float(np.abs(step[3:]).max()), float(np.abs(step[:3]).max()) * nominal.extent_mm)
        number += 1
        if number >= _FINE_STEPS or (moved < 0.1 * _LEAST_MM and number > _FIRST_STEPS + 1):
            break
    slopes = bounded * (5 * bounded - 4)  # of a distance's influence, weight · distance
    bending = (rows * slopes[:, None]).T @ rows
    if np.linalg.eigvalsh(bending)[0] <= 0:  # of a start that leads nowhere
        bending = matrix
    covariance = _clustered(rows * weights[:, None], distance, bending, there, nominal)
    rms_mm = float(np.sqrt(np.average(distance**2, weights=weights)))
    return Alignment(pose, rms_mm, about_origin(covariance, pose, centre), float(np.mean(weights > 0)))


def _clustered(
    weighed: FloatArray, distance: FloatArray, bending: FloatArray, there: FloatArray, nominal: Nominal
) -> FloatArray:
    """Return the fit's covariance; distances in one part of the nominal are alike and count once together.

    An M-estimator's: the scores' between two inverses of the slope of their sum, less than the weights' own
    matrix (Huber, Robust Statistics, 1981).
    """
    counts = weighed.any(axis=1)
    cells = np.floor((there[counts] - nominal.middle_mm) / (nominal.extent_mm / _CELLS)).astype(np.int64)
    _, cell, many = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    scores = np.zeros((len(many), 6))
    np.add.at(scores, cell.ravel(), (weighed * distance[:, None])[counts])
    inverse = np.linalg.inv(bending)
    least = np.diag([_SINGLE**2] * 3 + [(_SINGLE * nominal.extent_mm) ** 2] * 3)
    alike = float(many.sum() ** 2 / (many**2).sum())  # so many cells, were all alike
    return inverse @ (scores.T @ scores) @ inverse * _widened(alike) + least


def _widened(cells: float) -> float:
    """Return by what a covariance of so many cells grows so that its region of 95 % holds (Hotelling's T²)."""
    from scipy.stats import chi2, f

    free = max(cells - 6, _FEWEST_FREE)
    return float(6 * (free + 5) / free * f.ppf(0.95, 6, free) / chi2.ppf(0.95, 6))


def _share_near(points: FloatArray, nominal: Nominal, found: Alignment) -> float:
    return float(np.mean(_distances(points, nominal, found) < _PLACED * nominal.extent_mm))


def _cost(points: FloatArray, nominal: Nominal, found: Alignment) -> float:
    """Return the mean of squared distances, those of other things cut off."""
    return float(np.mean(np.minimum(_distances(points, nominal, found), 0.02 * nominal.extent_mm) ** 2))


def _distances(points: FloatArray, nominal: Nominal, found: Alignment) -> FloatArray:
    pose = found.cloud_from_reference
    return np.abs(nominal.distances_mm((points[:: max(1, len(points) // 4000)] - pose[:3, 3]) @ pose[:3, :3]))


def _turn_rad(pose: FloatArray) -> float:
    return float(np.arccos(np.clip((np.trace(pose[:3, :3]) - 1) / 2, -1, 1)))


def _others(chosen: Alignment, alike: Sequence[Alignment], nominal: Nominal) -> int:
    """Return how many poses there are beside the chosen one."""
    apart: list[FloatArray] = [chosen.cloud_from_reference]
    for one in alike:
        pose = one.cloud_from_reference
        if all(_apart(pose, other, nominal) for other in apart):
            apart.append(pose)
    return len(apart) - 1


def _apart(pose: FloatArray, other: FloatArray, nominal: Nominal) -> bool:
    between = np.linalg.inv(other) @ pose
    shift = between[:3, :3] @ nominal.middle_mm + between[:3, 3] - nominal.middle_mm
    return _turn_rad(between) > _TURNED_RAD or float(np.linalg.norm(shift)) > 0.05 * nominal.extent_mm


def _starts(points: FloatArray, facing: FloatArray, nominal: Nominal) -> list[FloatArray]:
    """Return a few poses that bring points and nominal near each other, out of turns all over."""
    from scipy.spatial.transform import Rotation

    weight = _TURN_WEIGHT * nominal.extent_mm
    places, across = nominal.spread(_SPREAD)
    places -= nominal.middle_mm
    target = np.concatenate([places, weight * across], axis=1).astype(np.float32)
    middle = points.mean(axis=0)
    between = Rotation.random(2, rng=np.random.default_rng(1))
    turns = [(one * other).as_matrix() for one in Rotation.create_group("I") for other in between]
    poses = [_pose(turn, places.mean(axis=0) - turn @ middle) for turn in turns]  # reference from cloud
    for count, steps, kept in _LOOKS:
        stride = max(1, len(points) // count)
        drawn = [_drawn(points[::stride], facing[::stride], target, weight, pose, steps) for pose in poses]
        drawn.sort(key=lambda pair: pair[0])
        poses = [pose for _, pose in drawn[:kept]]
    back = _pose(np.eye(3), nominal.middle_mm)
    return [np.linalg.inv(back @ pose).astype(float) for pose in poses]


def _drawn(
    points: FloatArray, facing: FloatArray, target: SingleArray, weight: float, pose: FloatArray, steps: int
) -> tuple[float, FloatArray]:
    """Return a pose drawn nearer, step by step, and what is left."""
    cost, places = np.inf, target[:, :3].astype(float)
    squares = (target**2).sum(axis=1)
    for _ in range(steps):
        there = points @ pose[:3, :3].T + pose[:3, 3]
        asked = np.concatenate([there, weight * (facing @ pose[:3, :3].T)], axis=1).astype(np.float32)
        between = asked @ target.T
        between *= -2
        between += squares
        number = between.argmin(axis=1)
        far = np.sqrt(np.maximum(between[np.arange(len(asked)), number] + (asked**2).sum(axis=1), 0)).astype(float)
        cut = 2.0 * float(np.median(far)) + 1e-9
        cost = float(np.mean(np.minimum(far, cut) ** 2))
        weights = np.maximum(1 - (far / cut) ** 2, 0.0)[:, None]
        ours, theirs = (there * weights).sum(axis=0), (places[number] * weights).sum(axis=0)
        total = weights.sum()
        mine, other = there - ours / total, places[number] - theirs / total
        left, _, right = np.linalg.svd((mine * weights).T @ other)
        turn = right.T @ np.diag([1, 1, np.sign(np.linalg.det(right.T @ left.T))]) @ left.T
        pose = _pose(turn, theirs / total - turn @ (ours / total)) @ pose
    return cost, pose


def _pose(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose
