"""The least covariance that any unbiased solver can reach for tool and turntable together (Cramér–Rao)."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.profile_cell import Shot, World
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.table_cell import TableTruth
from tests.bound import Beliefs, moved_by

_SINGULAR = 1e-12


@dataclass(frozen=True, eq=False)
class ChainBound:
    """Bounds from all captures of a session.

    Parameters
    ----------
    tool : (6, 6)
        Of tool0_from_laser, order rx ry rz tx ty tz, rad and mm; rotation on the right.
    axis_direction : (3, 3)
        Of the axis's unit vector in base, rad².
    axis_point : (3, 3)
        Of the centre of the first mounting's circle in base, mm².
    """

    tool: FloatArray
    axis_direction: FloatArray
    axis_point: FloatArray


def chain_bound(
    simulated: SimulatedSession, *, encoder_scale: bool = False, beliefs: Beliefs | None = None
) -> ChainBound:
    """Return the Cramér–Rao bounds of tool0_from_laser and of the turntable's axis from all captures.

    Unknown are the six of tool0_from_laser, the still sphere's centre, two tilts and two shifts of the axis, the
    sphere's place on the table for each mounting and, where asked, the encoder's scale.  Robot and encoder errors
    are part of each capture's noise; beliefs are unknown as well, see `tcp_bound`.  Faults and wobble are not
    accounted for.

    Raises
    ------
    InputError
        If the session has no turntable, or the captures leave a direction open.
    """
    world, table = simulated.world, simulated.table
    if world is None or table is None:
        raise InputError("a simulated cell with a turntable", "another", "Use a turntable scenario.")
    size = 14 + 3 * len(table.mounts_mm)  # tool 6, sphere 3, axis rx ry tx ty, encoder scale, mounts
    shots = [s for s in world.shots if not s.fault and len(s.true_points_mm)]
    extra = np.zeros(0) if beliefs is None else np.ones(11)
    information = np.diag(np.concatenate([np.zeros(size), extra]))
    for number, shot in enumerate(shots):
        moved = beliefs and moved_by(shots, number, world, beliefs)
        information += _information(shot, world, table, size, moved)
    if not encoder_scale:
        information[13, 13] = max(information[13, 13], 1.0) * 1e12  # known
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information * scale[:, None] * scale
    if np.linalg.eigvalsh(scaled)[0] < _SINGULAR:
        raise InputError("captures that determine tool and axis", "others", "Take another scenario.")
    covariance = np.linalg.inv(scaled) * scale[:, None] * scale
    rotation = table.base_from_turntable[:3, :3]
    # n = R z and R exp(r) give δn = R (r × z) = R (ry, −rx, 0).
    direction = np.column_stack([-rotation[:, 1], rotation[:, 0]])
    point = rotation  # of tx, ty and the first mounting's z: the origin is that mounting's circle's centre
    picked = covariance[np.ix_([11, 12, 16], [11, 12, 16])]
    return ChainBound(
        tool=covariance[:6, :6],
        axis_direction=direction @ covariance[9:11, 9:11] @ direction.T,
        axis_point=point @ picked @ point.T,
    )


def _information(shot: Shot, world: World, table: TableTruth, size: int, moved: FloatArray | None) -> FloatArray:
    """Return one capture's Fisher information, (size + n, size + n), n of `moved` (N, n)."""
    options = world.options
    mounting, arm = world.tool0_from_laser, shot.actual[:3, :3]
    points = shot.true_points_mm
    in_tool0 = points @ mounting[:3, :3].T + mounting[:3, 3]
    if shot.kind == "center":
        normals, sigma = np.eye(3), options.center_sigma_mm
        points, in_tool0 = np.repeat(points, 3, axis=0), np.repeat(in_tool0, 3, axis=0)
    else:
        normals = (points - shot.sphere_center_in_laser_mm) @ (arm @ mounting[:3, :3]).T / world.sphere_radius_mm
        sigma = options.point_sigma_mm
    by_shift = normals @ arm
    jacobian = np.zeros((len(points), size))
    jacobian[:, :3] = np.cross(points, normals @ (arm @ mounting[:3, :3]))
    jacobian[:, 3:6] = by_shift
    noise = [
        np.cross(in_tool0, by_shift) * options.orientation_sigma_rad,
        normals * options.position_sigma_mm,
    ]
    if shot.table is None:
        jacobian[:, 6:9] = -normals
    else:
        by_place, by_angle = _of_table(table, shot.table.mount, shot.table.angle_rad, size)
        jacobian -= normals @ by_place
        noise.append((normals @ by_angle * table.options.angle_sigma_rad)[:, None])
    if moved is not None:
        jacobian = np.hstack([jacobian, moved])
    spread = np.hstack(noise)
    inner = np.linalg.inv(sigma**2 * np.eye(spread.shape[1]) + spread.T @ spread)
    projected = spread.T @ jacobian
    return (jacobian.T @ jacobian - projected.T @ inner @ projected) / sigma**2


def _of_table(table: TableTruth, mount: int, angle_rad: float, size: int) -> tuple[FloatArray, FloatArray]:
    """Return how the sphere's centre in base moves with the unknowns (3, size) and with the table's angle (3,)."""
    rotation = table.base_from_turntable[:3, :3]
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    turned = rotation @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    x, y, z = turned.T @ (table.center_in_base(mount, angle_rad) - table.base_from_turntable[:3, 3])
    u, v = cosine * x - sine * y, sine * x + cosine * y  # in the turntable's frame, as turned
    by_angle = rotation @ np.array([-v, u, 0.0])
    columns = np.zeros((3, size))
    columns[:, 9] = rotation @ np.array([0.0, -z, v])  # rx: (1, 0, 0) × (u, v, z)
    columns[:, 10] = rotation @ np.array([z, 0.0, -u])
    columns[:, 11:13] = rotation[:, :2]
    columns[:, 13] = angle_rad * by_angle
    columns[:, 14 + 3 * mount : 17 + 3 * mount] = turned
    return columns, by_angle
