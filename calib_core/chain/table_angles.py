"""A table whose angles nobody read: they are found from where the sphere stands.

Three captures of one mounting, each with its two possible sides, lie on one circle; the circle about whose axis
most captures of all mountings stand at their own mounting's radius and height wins, as with known angles.  A
capture's angle is then its sphere's azimuth about that axis.  What the angles said is missing afterwards: the
sense in which the table turns, its zero, its encoder, and one of the three numbers of every capture.
"""

from dataclasses import replace

import numpy as np

from calib_core.chain.observations import SphereSize, TableObservation, TableObservations
from calib_core.chain.spread import (
    AGREE_MM,
    TRIALS_BY_ALL,
    most_agreed,
    nearest_side,
    robust_costs,
    spread_captures,
)
from calib_core.chain.table_start import Mounts, both_centers_in_base
from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.messages import plural

UNKNOWN_ANGLE_SIGMA_RAD = 0.02
"""Of an angle that was found from the captures: millimetres along the circle, where they then say next to nothing.

Much larger, the mountings' own azimuths would be free to drift, and circles are straight only so far.
"""

_TRIPLES = 60
_LEAST_ON_A_CIRCLE = 4
_LARGEST_RADIUS_MM = 5000.0
_LEAST_AREA = 0.02  # of a triangle beside the square of its longest edge: flatter ones fix no circle


def with_found_angles(
    observations: TableObservations, sphere: SphereSize, mount_from_laser: Mounts, direction: int = 1
) -> list[TableObservation]:
    """Return captures with the angles that their spheres' places tell, the first one's zero.

    Parameters
    ----------
    observations : captures whose angles are ignored
    sphere : SphereSize
    mount_from_laser : RigidTransform, or that of each scanner by its name
    direction : {1, -1}
        The sense in which angles are to count, right-handed about the axis that points up, or left-handed.

    Raises
    ------
    MotionError
        If no mounting has four captures at different places.
    """
    centers = both_centers_in_base(observations, sphere, mount_from_laser)
    mounts = np.array([o.mount for o in observations])
    names = list(dict.fromkeys(mounts.tolist()))
    few = np.zeros(len(mounts), dtype=bool)
    few[spread_captures(np.array([names.index(m) for m in mounts.tolist()]), np.zeros(len(mounts)))] = True
    axis, point = _best_axis(centers, mounts, few)
    axis = axis * (1.0 if axis[2] >= 0 else -1.0)
    along, around, azimuth = _cylindrical(centers, axis, point)
    angles = np.zeros(len(observations))
    for mount in names:
        own = np.flatnonzero(mounts == mount)
        place = most_agreed(np.stack([around[own], along[own]], axis=2), few[own], exact=True)
        off = np.hypot(around[own] - place[0], along[own] - place[1])
        chosen = azimuth[own, np.argmin(off, axis=1)]
        angles[own] = np.mod(chosen - chosen[0], 2 * np.pi)
    return [replace(o, angle_rad=direction * float(a)) for o, a in zip(observations, angles, strict=True)]


def _best_axis(centers: FloatArray, mounts: np.ndarray, few: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Return direction and a point of the axis of the circle on which most captures agree, sought with `few`."""
    circles: list[tuple[FloatArray, FloatArray]] = []
    for mount in dict.fromkeys(mounts.tolist()):
        own = np.flatnonzero(mounts == mount)
        if len(own) >= _LEAST_ON_A_CIRCLE:
            found = (_circle_of(corners) for corners in _trials(centers[own]))
            circles += [circle for circle in found if circle is not None]
    if not circles:
        raise MotionError(
            "four captures or more of one mounting, the table turned between them (angles unknown)",
            plural(
                "{count} capture, none of whose mountings has four at different places",
                "{count} captures, none of whose mountings has four at different places",
                by="count",
                count=len(mounts),
            ),
            "Turn the table by 45° and capture the sphere again, all around; then do so at a second height.",
        )
    costs = [_axis_cost(centers, mounts, circle, few, exact=False) for circle in circles]
    if not few.all():
        best = np.sort(np.argsort(costs, kind="stable")[:TRIALS_BY_ALL])
        circles = [circles[n] for n in best]
        costs = [_axis_cost(centers, mounts, circle, few, exact=True) for circle in circles]
    return circles[int(np.argmin(costs))]


def _axis_cost(
    centers: FloatArray, mounts: np.ndarray, circle: tuple[FloatArray, FloatArray], few: np.ndarray, exact: bool
) -> float:
    """Return the robust cost of all captures about an axis, each mounting where most of its captures agree."""
    along, around, _ = _cylindrical(centers, *circle)
    cost = 0.0
    for mount in dict.fromkeys(mounts.tolist()):
        own = np.flatnonzero(mounts == mount)
        places = np.stack([around[own], along[own]], axis=2)
        place = most_agreed(places, few[own], exact)
        cost += float(robust_costs(nearest_side(place[None], places)[0]))
    return cost


def _trials(centers: FloatArray) -> FloatArray:
    """Return triples of centres (N, 3, 3) of one mounting (K, 2, 3), all their sides."""
    rng = np.random.default_rng(len(centers))
    count = len(centers)
    triples = np.array([rng.permutation(count)[:3] for _ in range(_TRIPLES)])
    triples = np.unique(np.sort(triples, axis=1), axis=0)
    sides = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)])
    return centers[triples[:, None], sides[None]].reshape(-1, 3, 3)


def _circle_of(corners: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return normal and centre of the circle through three points (3, 3); None where they nearly are on a line."""
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    normal = np.cross(a, b)
    area2 = float(normal @ normal)
    longest2 = max(float(a @ a), float(b @ b), float((a - b) @ (a - b)))
    if area2 < (_LEAST_AREA * longest2) ** 2 or longest2 < AGREE_MM**2:
        return None
    center = corners[0] + np.cross(normal, (b @ b) * a - (a @ a) * b) / (2 * area2)
    if np.linalg.norm(center - corners[0]) > _LARGEST_RADIUS_MM:
        return None
    return normal / np.sqrt(area2), center


def _cylindrical(
    centers: FloatArray, axis: FloatArray, point: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return height along the axis, distance from it and azimuth about it, (K, 2) each, of centres (K, 2, 3)."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    local = centers - point
    x, y = local @ across, local @ np.cross(axis, across)
    return local @ axis, np.hypot(x, y), np.arctan2(y, x)
