"""The simulated TCP cell: where sphere, robot and scanner really are, and what is recorded of it."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calib_core.simulation.motion import FloatArray, back, pose, quaternion_wxyz, turn
from calib_core.simulation.scenarios import CaptureKind, Fault, TcpScenario
from calib_core.simulation.sensor import arc_points, background_depths, cap_points, columns, noisy

_DROPPED = 0.002  # the fraction of columns that return nothing by chance
_TRANSLATION_SHIFT_MM = (30.0, 80.0)
_SOLID_ENOUGH = 0.15  # the volume that three unit shifts span; 0 where they lie in a plane


@dataclass(frozen=True)
class TableReading:
    """How the turntable stood in one capture.

    Parameters
    ----------
    angle_rad : float
        How far it truly had turned about its axis, right-handed.
    mount : int
        Which mounting of the sphere it truly was.
    reported_angle : float
        The record's `table_deg`: in degrees, unless the user was mistaken.
    reported_mount : str
        The record's `mount`.
    """

    angle_rad: float
    mount: int
    reported_angle: float
    reported_mount: str


@dataclass(frozen=True, eq=False)
class Shot:
    """One capture: what is true of it and what was measured.

    Parameters
    ----------
    name : str
    kind : str
    commanded, actual : (4, 4)
        base_from_tool0 as the robot reports it and as it is.
    sphere_center_in_base_mm : (3,)
        Where the sphere stood during this capture.
    sphere_center_in_laser_mm : (3,)
    true_points_mm : (N, 3)
        On the sphere, in the laser frame, without noise; the centre alone for kind `center`.
    measured_points_mm : (M, 3)
        As the file has them; NaN in z where nothing came back.
    fault : str or None
    reported : (4, 4)
        The pose that the session's record has.
    table : TableReading or None
        How the turntable stood; None where the sphere stands on the floor.
    """

    name: str
    kind: CaptureKind
    commanded: FloatArray
    actual: FloatArray
    sphere_center_in_base_mm: FloatArray
    sphere_center_in_laser_mm: FloatArray
    true_points_mm: FloatArray
    measured_points_mm: FloatArray
    fault: Fault | None
    reported: FloatArray
    table: TableReading | None = None

    @property
    def side(self) -> int:
        """+1 where the sphere's centre is at y > 0 of the plane of light, −1 where it is at y < 0."""
        return 1 if self.sphere_center_in_laser_mm[1] > 0 else -1


@dataclass(frozen=True, eq=False)
class World:
    """The truth of one simulated cell, and its captures.

    Where the robot carries the ball, `tool0_from_laser` holds base_from_laser and `sphere_center_in_base_mm` where
    the ball is on the flange.
    """

    tool0_from_laser: FloatArray
    sphere_center_in_base_mm: FloatArray
    sphere_radius_mm: float
    options: TcpScenario
    shots: tuple[Shot, ...] = field(default_factory=tuple)

    def truth(self) -> dict[str, Any]:
        """Return the truth as JSON data."""
        o = self.options
        scanner_on, ball_on = ("base", "tool0") if o.ball_on_flange else ("tool0", "base")
        return {
            f"{scanner_on}_from_laser": self.tool0_from_laser.tolist(),
            f"sphere_center_in_{ball_on}_mm": self.sphere_center_in_base_mm.tolist(),
            "sphere_diameter_mm": 2 * self.sphere_radius_mm,
            "base_from_tool0": {s.name: s.actual.tolist() for s in self.shots},
            "sides": {s.name: s.side for s in self.shots if s.kind == "profile"},
            "sigmas": {
                "point_sigma_mm": o.point_sigma_mm,
                "position_sigma_mm": o.position_sigma_mm,
                "orientation_sigma_rad": o.orientation_sigma_rad,
                "orientation_sigma_deg": float(np.rad2deg(o.orientation_sigma_rad)),
            },
            "spoiled": [s.name for s in self.shots if s.fault],
            "faults": {s.name: s.fault for s in self.shots if s.fault},
        }


def build_world(options: TcpScenario, rng: np.random.Generator) -> World:
    """Return a cell with its captures, all drawn from `rng`."""
    mounting = turn([0.0, 0.0, -1.6]) @ turn([0.35, 0.0, 0.0]) @ turn(rng.uniform(-0.1, 0.1, 3))
    diameter = options.sphere_diameter_mm + options.sphere_diameter_sigma_mm * rng.standard_normal()
    world = World(
        tool0_from_laser=pose(mounting, np.array([35.0, -120.0, 140.0]) + rng.uniform(-5, 5, 3)),
        sphere_center_in_base_mm=np.array([900.0, 150.0, 420.0]) + rng.uniform(-60, 60, 3),
        sphere_radius_mm=float(diameter) / 2,
        options=options,
    )
    # The scanner looks down at the nominal orientation.
    nominal = turn([np.pi, 0.0, 0.0]) @ turn([0.0, 0.0, 0.4]) @ turn([0.35, 0.0, 0.0]).T
    if options.ball_on_flange:
        world = replace(world, **_before_fixed_scanner(rng))
    centers = _centers_in_laser(options, rng)
    orientations = _orientations(nominal, options, rng)
    commanded = [commanded_pose(world, r, c) for r, c in zip(orientations, centers, strict=True)]
    faults = _faults(len(commanded), options, rng)
    shots = tuple(_shot(world, k, commanded, faults.get(k), rng) for k in range(len(commanded)))
    return replace(world, shots=shots)


def _before_fixed_scanner(rng: np.random.Generator) -> dict[str, FloatArray]:
    """Return base_from_laser of a scanner that looks at the robot, and where the ball is on the flange."""
    looking_back = turn([0.0, 0.0, 0.5]) @ turn([0.0, -2.0, 0.0]) @ turn(rng.uniform(-0.1, 0.1, 3))
    return {
        "tool0_from_laser": pose(looking_back, np.array([1300.0, -150.0, 700.0]) + rng.uniform(-60, 60, 3)),
        "sphere_center_in_base_mm": np.array([25.0, -40.0, 130.0]) + rng.uniform(-10, 10, 3),
    }


def _centers_in_laser(options: TcpScenario, rng: np.random.Generator) -> FloatArray:
    """Return where the sphere's centre is to be seen in each capture, (N, 3)."""
    count = options.translations + options.orientations
    if options.pivot:
        return np.tile(draw_centers(1, options, rng), (count, 1))
    for _ in range(10_000):
        centers = draw_centers(count, options, rng)
        if _shifts_are_good(centers[: min(options.translations, 4)]):
            return centers
    raise AssertionError("the measuring range leaves no room for translations of 30 to 80 mm")


def draw_centers(count: int, options: TcpScenario, rng: np.random.Generator) -> FloatArray:
    """Return places of the sphere's centre in L (count, 3), as the scenario spreads them."""
    radius = options.sphere_diameter_mm / 2
    y = rng.uniform(options.offset_low, options.offset_high, count) * radius * rng.choice([-1.0, 1.0], count)
    x = rng.uniform(-options.lateral_mm, options.lateral_mm, count)
    return np.column_stack([x, y, rng.uniform(options.near_mm, options.far_mm, count)])


def _shifts_are_good(centers: FloatArray) -> bool:
    """Whether the first shifts are 30 to 80 mm long and, if three, not in one plane."""
    if len(centers) < 2:
        return True
    shifts = centers[1:] - centers[0]
    lengths = np.sqrt((shifts**2).sum(axis=1))
    low, high = _TRANSLATION_SHIFT_MM
    if lengths.min() < low or lengths.max() > high:
        return False
    return len(shifts) < 3 or abs(np.linalg.det(shifts / lengths[:, None])) > _SOLID_ENOUGH


def _orientations(nominal: FloatArray, options: TcpScenario, rng: np.random.Generator) -> list[FloatArray]:
    tiny = rng.standard_normal((options.translations, 3)) * options.equal_orientation_sigma_rad
    large = rng.uniform(-options.orientation_range_rad, options.orientation_range_rad, (options.orientations, 3))
    return [nominal @ turn(v) for v in (*tiny, *large)]


def commanded_pose(world: World, rotation: FloatArray, center_in_laser_mm: FloatArray) -> FloatArray:
    """Return the base_from_tool0 that brings the sphere to a place of the laser frame, as a robot reports it."""
    center_in_tool0 = world.tool0_from_laser[:3, :3] @ center_in_laser_mm + world.tool0_from_laser[:3, 3]
    if world.options.ball_on_flange:  # there it is to be in base
        return rounded_pose(pose(rotation, center_in_tool0 - rotation @ world.sphere_center_in_base_mm))
    return rounded_pose(pose(rotation, world.sphere_center_in_base_mm - rotation @ center_in_tool0))


def pose_numbers(base_from_tool0: FloatArray) -> list[float]:
    """Return x y z (mm, three decimals) and q1 q2 q3 q4 (scalar first, six decimals): ABB's order."""
    position = np.round(base_from_tool0[:3, 3], 3).tolist()
    return [*position, *np.round(quaternion_wxyz(base_from_tool0[:3, :3]), 6).tolist()]


def rounded_pose(base_from_tool0: FloatArray) -> FloatArray:
    """Return the pose that its printed numbers mean."""
    numbers = pose_numbers(base_from_tool0)
    w, *v = np.array(numbers[3:]) / np.linalg.norm(numbers[3:])
    length = float(np.linalg.norm(v))
    axis = np.array(v) / length if length > 0 else np.zeros(3)
    return pose(turn(2 * np.arctan2(length, w) * axis), numbers[:3])


def _faults(count: int, options: TcpScenario, rng: np.random.Generator) -> dict[int, Fault]:
    chosen = rng.permutation(count)[: len(options.faults)]
    return {int(k): fault for k, fault in zip(chosen, options.faults, strict=True)}


def _shot(
    world: World, k: int, commanded: list[FloatArray], fault: Fault | None, rng: np.random.Generator
) -> Shot:
    options = world.options
    actual = true_pose(commanded[k], options, rng)
    center_in_base = world.sphere_center_in_base_mm
    if fault == "moved-sphere":
        direction = rng.standard_normal(3)
        center_in_base = center_in_base + options.moved_mm * direction / np.linalg.norm(direction)
    reported = commanded[k]
    if fault == "wrong-pose":
        others = [j for j in range(len(commanded)) if j != k]
        reported = commanded[int(rng.choice(others))]
    kind = options.kinds[k % len(options.kinds)]
    shot = shot_from(world, f"p{k + 1:02d}", kind, commanded[k], actual, center_in_base, rng)
    return replace(shot, fault=fault, reported=reported)


def shot_from(
    world: World,
    name: str,
    kind: CaptureKind,
    commanded: FloatArray,
    actual: FloatArray,
    center_in_base: FloatArray,
    rng: np.random.Generator,
) -> Shot:
    """Return a capture without a fault of the sphere at a place of the base, from where the arm really is."""
    center, true_points, measured = measure(kind, world, actual, center_in_base, rng)
    return Shot(name, kind, commanded, actual, center_in_base, center, true_points, measured, None, commanded)


def true_pose(commanded: FloatArray, options: TcpScenario, rng: np.random.Generator) -> FloatArray:
    """Return where the arm really goes when it reports a pose, both (4, 4)."""
    error_rad = rng.standard_normal(3) * options.orientation_sigma_rad
    error_mm = rng.standard_normal(3) * options.position_sigma_mm
    return pose(commanded[:3, :3] @ turn(error_rad), commanded[:3, 3] + error_mm)


def measure(
    kind: CaptureKind, world: World, actual: FloatArray, center_in_base: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what a capture sees in L: the sphere's centre, the true points (N, 3), the measured ones (M, 3)."""
    if world.options.ball_on_flange:
        laser_from_base = back(world.tool0_from_laser) @ actual
    else:
        laser_from_base = back(actual @ world.tool0_from_laser)
    center = laser_from_base[:3, :3] @ center_in_base + laser_from_base[:3, 3]
    return center, *_measure(kind, world, center, center_in_base, laser_from_base, rng)


def _measure(
    kind: CaptureKind,
    world: World,
    center: FloatArray,
    center_in_base: FloatArray,
    laser_from_base: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return the true points on the sphere (N, 3) and the measured ones (M, 3)."""
    options, radius = world.options, world.sphere_radius_mm
    if kind == "center":
        return center[None], center[None] + rng.standard_normal((1, 3)) * options.center_sigma_mm
    points = (arc_points if kind == "profile" else cap_points)(center, radius, options)
    measured = noisy(points, center, radius, rng.standard_normal(len(points)) * options.point_sigma_mm)
    if kind == "cloud":
        return points, measured
    keep = rng.random(len(points)) >= _DROPPED
    points, measured = points[keep], measured[keep]
    return points, _whole_profile(measured, world, center, center_in_base, laser_from_base, rng)


def _whole_profile(
    on_sphere: FloatArray,
    world: World,
    center: FloatArray,
    center_in_base: FloatArray,
    laser_from_base: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Return all columns (M, 3): the arc, what else is in view, stray points, and NaN where nothing is."""
    options = world.options
    x = columns(options)
    z = np.full(len(x), np.nan)
    if options.background:
        z = background_depths(x, laser_from_base, center_in_base) + rng.standard_normal(len(x)) * (
            options.point_sigma_mm
        )
        z[(z < options.window_near_mm) | (z > options.window_far_mm)] = np.nan
        circle = np.sqrt(max(world.sphere_radius_mm**2 - center[1] ** 2, 0.0))
        z[np.abs(x - center[0]) <= circle] = np.nan  # the sphere is in front of it
    hit = np.round((on_sphere[:, 0] - x[0]) / options.pitch_mm).astype(int)
    z[hit] = on_sphere[:, 2]
    if options.stray_fraction:
        chance = np.where(np.isnan(z), options.stray_fraction, options.stray_fraction / 5)
        stray = rng.random(len(x)) < chance
        low, high = max(options.window_near_mm, 100.0), min(options.window_far_mm, 280.0)
        z[stray] = rng.uniform(low, high, int(stray.sum()))
    return np.column_stack([x, np.zeros_like(x), z])
