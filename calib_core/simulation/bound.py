"""The least covariance that any unbiased solver can reach on a simulated session (Cramér–Rao)."""

import numpy as np

from calib_core.errors import InputError
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.profile_cell import Shot, World
from calib_core.simulation.session import SimulatedSession

_SINGULAR = 1e-12


def tcp_bound(simulated: SimulatedSession) -> FloatArray:
    """Return the Cramér–Rao bound of tool0_from_laser, (6, 6), order rx ry rz tx ty tz, rad and mm.

    The rotation perturbs on the right, R·exp(r), the translation adds.  Unknown are the six of tool0_from_laser
    and the sphere's centre; the diameter is known.  A capture's residuals are the distances of its points to the
    sphere; their covariance is σ_point² I plus what the robot's pose errors add, so that these are integrated out.
    Spoiled captures, stray points and captures of a turntable give nothing.

    Raises
    ------
    InputError
        If the captures leave a direction undetermined: no bound exists.
    """
    world = simulated.world
    if world is None:
        raise InputError("a simulated cell that measures points", "one that takes frames", "Use a tcp scenario.")
    information = np.zeros((9, 9))
    for shot in world.shots:
        if not shot.fault and shot.table is None and len(shot.true_points_mm):
            information += _information(shot, world)
    scale = 1 / np.sqrt(np.diag(information))  # radians and millimetres side by side
    scaled = information * scale[:, None] * scale
    if np.linalg.eigvalsh(scaled)[0] < _SINGULAR:
        raise InputError(
            "captures that determine the whole of tool0_from_laser",
            f"the scenario {simulated.truth['scenario']}, which does not",
            "Take a scenario with translations and orientations.",
        )
    return np.array((np.linalg.inv(scaled) * scale[:, None] * scale)[:6, :6], dtype=np.float64)


def _information(shot: Shot, world: World) -> FloatArray:
    """Return the Fisher information (9, 9) of one capture on rx ry rz tx ty tz cx cy cz."""
    options = world.options
    mounting = world.tool0_from_laser
    arm = shot.actual[:3, :3]
    points = shot.true_points_mm
    in_tool0 = points @ mounting[:3, :3].T + mounting[:3, 3]
    if shot.kind == "center":
        normals = np.eye(3)
        points, in_tool0 = np.repeat(points, 3, axis=0), np.repeat(in_tool0, 3, axis=0)
        sigma = options.center_sigma_mm
    else:
        normals = (points - shot.sphere_center_in_laser_mm) @ (arm @ mounting[:3, :3]).T / world.sphere_radius_mm
        sigma = options.point_sigma_mm
    # How far the points move along the sphere's normals with r and t, and with the arm's errors:
    # n · A (r × p) = r · (p × Aᵀ n).
    by_turn = np.cross(points, normals @ (arm @ mounting[:3, :3]))
    by_shift = normals @ arm
    by_arm_turn = np.cross(in_tool0, by_shift)
    jacobian = np.hstack([by_turn, by_shift, -normals])
    spread = np.hstack([by_arm_turn * options.orientation_sigma_rad, normals * options.position_sigma_mm])
    # Woodbury: (σ² I + S Sᵀ)⁻¹ without the large matrix.
    inner = np.linalg.inv(sigma**2 * np.eye(6) + spread.T @ spread)
    projected = spread.T @ jacobian
    return (jacobian.T @ jacobian - projected.T @ inner @ projected) / sigma**2
