"""The least covariance that any unbiased solver can reach on a simulated session (Cramér–Rao)."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.profile_cell import Shot, World
from calib_core.simulation.session import SimulatedSession

_SINGULAR = 1e-12


@dataclass(frozen=True)
class Beliefs:
    """Standard deviations of what is not known of a cell before any capture, beside its poses and points.

    Attributes
    ----------
    scale, shear : float
        Of the scanner's x and z each; of x by z.
    bow : float
        Sag of z over the width that is seen, as a share of half that width.
    incidence_mm : float
        Of each of three shapes of the error by the angle at which light meets the surface: sin² − 0.3,
        sin⁴ − 0.15, sin⁸ − 0.05.
    arm_scale : float
        Of the arm's lengths.
    drift_mm : float
        Of the sphere from the session's middle to its end, per axis.
    """

    scale: float = 0.005
    shear: float = 0.01
    bow: float = 0.001
    incidence_mm: float = 0.02
    arm_scale: float = 2e-4
    drift_mm: float = 0.04


def tcp_bound(simulated: SimulatedSession, beliefs: Beliefs | None = None) -> FloatArray:
    """Return the Cramér–Rao bound of tool0_from_laser, (6, 6), order rx ry rz tx ty tz, rad and mm.

    The rotation perturbs on the right, R·exp(r), the translation adds.  Unknown are the six of tool0_from_laser
    and the sphere's centre; the diameter is known.  A capture's residuals are the distances of its points to the
    sphere; their covariance is σ_point² I plus what the robot's pose errors add, so that these are integrated out.
    Spoiled captures, stray points and captures of a turntable give nothing.  With `beliefs` the scanner's errors,
    the arm's length and a drift are unknown as well, and known beforehand as these say (van Trees' bound).

    Raises
    ------
    InputError
        If the captures leave a direction undetermined: no bound exists.
    """
    world = simulated.world
    if world is None:
        raise InputError("a simulated cell that measures points", "one that takes frames", "Use a tcp scenario.")
    shots = [s for s in world.shots if not s.fault and s.table is None and len(s.true_points_mm)]
    information = np.zeros((9, 9) if beliefs is None else (20, 20))
    for number, shot in enumerate(shots):
        information += _information(shot, world, beliefs and moved_by(shots, number, world, beliefs))
    information[9:, 9:] += np.eye(len(information) - 9)
    scale = 1 / np.sqrt(np.diag(information))  # radians and millimetres side by side
    scaled = information * scale[:, None] * scale
    if np.linalg.eigvalsh(scaled)[0] < _SINGULAR:
        raise InputError(
            "captures that determine the whole of tool0_from_laser",
            f"the scenario {simulated.truth['scenario']}, which does not",
            "Take a scenario with translations and orientations.",
        )
    return np.array((np.linalg.inv(scaled) * scale[:, None] * scale)[:6, :6], dtype=np.float64)


def moved_by(shots: list[Shot], number: int, world: World, beliefs: Beliefs) -> FloatArray:
    """Return how far one standard deviation of each belief moves a capture's points off the sphere, (N, 11)."""
    shot = shots[number]
    points = shot.true_points_mm
    normals = (points - shot.sphere_center_in_laser_mm) / world.sphere_radius_mm
    x, z = points[:, 0], points[:, 2]
    half_width = max(float(np.abs(s.true_points_mm[:, 0]).max()) for s in shots)
    square = 1 - normals[:, 2] ** 2
    scanner = [normals[:, 0] * x, normals[:, 2] * z, normals[:, 0] * z, normals[:, 2] * x**2 / half_width]
    sizes = np.array([beliefs.scale, beliefs.scale, beliefs.shear, beliefs.bow])
    light = np.column_stack([square - 0.3, square**2 - 0.15, square**4 - 0.05]) * beliefs.incidence_mm
    in_base = normals @ (shot.actual[:3, :3] @ world.tool0_from_laser[:3, :3]).T
    middle = np.mean([s.actual[:3, 3] for s in shots], axis=0)
    arm = in_base @ (shot.actual[:3, 3] - middle) * beliefs.arm_scale
    when = -1 + 2 * number / max(len(shots) - 1, 1)
    return np.column_stack([np.column_stack(scanner) * sizes, light, arm, in_base * when * beliefs.drift_mm])


def _information(shot: Shot, world: World, moved: FloatArray | None) -> FloatArray:
    """Return the Fisher information (9 + n, 9 + n) of one capture on rx ry rz tx ty tz cx cy cz, and n beliefs."""
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
    jacobian = np.hstack([by_turn, by_shift, -normals, *([] if moved is None else [moved])])
    spread = np.hstack([by_arm_turn * options.orientation_sigma_rad, normals * options.position_sigma_mm])
    # Woodbury: (σ² I + S Sᵀ)⁻¹ without the large matrix.
    inner = np.linalg.inv(sigma**2 * np.eye(6) + spread.T @ spread)
    projected = spread.T @ jacobian
    return (jacobian.T @ jacobian - projected.T @ inner @ projected) / sigma**2
