"""A troubled cell: plan, arm, sphere, scanners and bookkeeping, each of which may be changed."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from calib_core.simulation.motion import FloatArray, back, pose, turn
from calib_core.simulation.profile_cell import pose_numbers
from tests.trouble.arm import ArmErrors, flange, joints_for

NOMINAL = turn([np.pi, 0.0, 0.0]) @ turn([0.0, 0.0, 0.4]) @ turn([0.35, 0.0, 0.0]).T
"""How the flange stands in base where it is not tilted (3, 3)."""

Scanners = Literal["one", "fixed", "two", "both"]
"""One on the flange, or that stands still before a ball on the flange; two on the flange, or one of each."""

NAMES = ("left", "right")
_HELD_MM = np.array([25.0, -40.0, 130.0])
_BEFORE_MM = 190.0


@dataclass(eq=False)
class Plan:
    """What a trouble may change before a session is taken; lengths in mm, angles in rad.

    Attributes
    ----------
    alike
        How many of the first captures are taken from nearly one pose.
    radius_mm, told_diameter_mm, told_diameter_sigma_mm
        The sphere as it is, and as it is told.
    shifts, tilts, tilt_rad, spread_mm
        How many shifts and tilts, how far the tilts go (per component), where the sphere is seen.
    position_mm, orientation_rad
        Each pose's own random error.
    arm : ArmErrors or None
    pose_error : callable
        Pose (4, 4) commanded, number of the capture, rng → pose that is reached, beside the above.
    too_long : float
        By what share the arm tells its lengths too long.
    sphere_at : callable
        Capture's number, number of captures → the sphere's shift in base (3,).
    scanner : callable
        Points (N, 2) that a right scanner gives, rng → those that this one gives.
    laser_from_files : (4, 4)
        Where the scanner is meant to count in a frame of its own.
    noise : callable
        Number of points, rng → errors along the ray in units of `point_mm`.
    surface : callable
        Angles of the surface normal to the light (N,), rng → distance off the sphere (N,), mm.
    sheet : callable
        x in the scanner's frame (N,) → how far the light lies off its plane there (N,), mm.
    mounting : callable
        Capture's number → what moves the scanner on the flange (4, 4).
    book : callable
        Poses as lists of numbers and profiles, rng → the same as somebody wrote them down.
    told : dict
        Merged into the cell's record.
    """

    alike: int = 0
    radius_mm: float = 20.0
    told_diameter_mm: float | None = None
    told_diameter_sigma_mm: float | None = None
    shifts: int = 4
    tilts: int = 11
    tilt_rad: float = 0.5
    near_mm: float = 150.0
    far_mm: float = 230.0
    lateral_mm: float = 20.0
    offset: tuple[float, float] = (0.2, 0.8)
    one_side: bool = False
    pitch_mm: float = 0.1
    arc_deg: float = 65.0
    point_mm: float = 0.02
    position_mm: float = 0.03
    orientation_rad: float = 1e-4
    arm: ArmErrors | None = None
    pose_error: Callable[[FloatArray, int, np.random.Generator], FloatArray] = lambda p, k, rng: p
    too_long: float = 0.0
    sphere_at: Callable[[int, int], FloatArray] = lambda k, n: np.zeros(3)
    scanner: Callable[[FloatArray, np.random.Generator], FloatArray] = lambda p, rng: p
    laser_from_files: FloatArray = field(default_factory=lambda: np.eye(4))
    noise: Callable[[int, np.random.Generator], FloatArray] = lambda n, rng: rng.standard_normal(n)
    surface: Callable[[FloatArray, np.random.Generator], FloatArray] = lambda angle, rng: np.zeros_like(angle)
    sheet: Callable[[FloatArray], FloatArray] = np.zeros_like
    background: Callable[[FloatArray, FloatArray, float, np.random.Generator], FloatArray] | None = None
    mounting: Callable[[int], FloatArray] = lambda k: np.eye(4)
    book: Callable[[list[list[float]], list[FloatArray], np.random.Generator], None] = lambda p, f, rng: None
    told: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Trouble:
    """One class of trouble.

    `clean`: what every cell has, so that 95 % must pass; `hidden`: what no capture can show, listed apart, and
    `hidden_from` what only some cells' captures can.
    """

    name: str
    change: Callable[[Any, np.random.Generator], None]
    clean: bool = False
    hidden: bool = False
    hidden_from: tuple[Scanners, ...] = ()

    def is_hidden(self, scanners: Scanners) -> bool:
        """Return whether no capture of such a cell can show it."""
        return self.hidden or scanners in self.hidden_from


@dataclass(frozen=True, eq=False)
class Mounted:
    """A scanner: its name if any, what carries it, where it is there (4, 4), and the ball that it sees (3,).

    That ball stands in base before a scanner on the flange; it is on the flange before one that stands in base.
    """

    name: str | None
    on: Literal["tool0", "base"]
    carrier_from_laser: FloatArray
    ball: FloatArray


def mounted(
    scanners: Scanners, tool: FloatArray, ball: FloatArray, rng: np.random.Generator, stand: FloatArray | None
) -> list[Mounted]:
    """Return a cell's scanners by where one is on the flange, and the ball (3,) in base that it sees.

    One that stands still does so where `stand` (4, 4) says, or above the ball's place.
    """
    left, right = NAMES
    if scanners == "one":
        return [Mounted(None, "tool0", tool, ball)]
    if scanners == "two":
        beside = tool @ pose(turn([0.0, 0.5, 0.0]), [-90.0, 12.0, 20.0])
        return [Mounted(left, "tool0", tool, ball), Mounted(right, "tool0", beside, ball)]
    if stand is None:
        stand = pose(NOMINAL, ball - NOMINAL @ (tool[:3, :3] @ [0.0, 0.0, _BEFORE_MM] + tool[:3, 3])) @ tool
    held = _HELD_MM + rng.uniform(-5, 5, 3)
    if scanners == "fixed":
        return [Mounted(None, "base", stand, held)]
    return [Mounted(left, "tool0", tool, ball), Mounted(right, "base", stand, held)]


def seen_by(plan: Plan) -> Callable[[FloatArray], FloatArray]:
    """Return the scanner's errors without its noise: points (N, 2) that a right one gives → those of this one."""
    return lambda points: plan.scanner(points, np.random.default_rng(0))


def drawn_tool(rng: np.random.Generator) -> FloatArray:
    """Return how a scanner is mounted on the flange (4, 4)."""
    mounting = turn([0.0, 0.0, -1.6]) @ turn([0.35, 0.0, 0.0]) @ turn(rng.uniform(-0.1, 0.1, 3))
    return pose(mounting, np.array([35.0, -120.0, 140.0]) + rng.uniform(-5, 5, 3))


def of_still_balls(
    arm: "Arm", scanners: list[Mounted], tilts: Iterable[FloatArray], rng: np.random.Generator
) -> list["Taken"]:
    """Return captures of balls that stand still, or are on the flange: one a tilt (3,), the scanners in turn."""
    plan = arm.plan
    count = plan.shifts + plan.tilts
    first = drawn_place(plan, rng) if plan.alike else np.zeros(3)
    found: list[Taken] = []
    for k, tilt in enumerate(tilts):
        place, rotation = drawn_place(plan, rng), NOMINAL @ turn(tilt)
        if k < plan.alike:
            place, rotation = first + rng.standard_normal(3), NOMINAL @ turn(0.002 * rng.standard_normal(3))
        scanner = scanners[k % len(scanners)]
        centers = scanner.ball, scanner.ball + plan.sphere_at(k, count)
        found.append(take(arm, scanner, rotation, place, centers, k, rng))
    return found


@dataclass(eq=False)
class Arm:
    """The arm of a session: its plan, and the joints (6,) at which it stood last."""

    plan: Plan
    joints_rad: FloatArray | None = None

    def led_to(self, commanded: FloatArray, k: int, rng: np.random.Generator) -> FloatArray:
        """Return the pose (4, 4) that a commanded one becomes, before each pose's own random error."""
        plan, reached = self.plan, commanded
        if plan.arm is not None:
            self.joints_rad = joints_for(commanded, self.joints_rad)
            reached = flange(self.joints_rad, plan.arm)
        return plan.pose_error(reached, k, rng)


@dataclass(frozen=True, eq=False)
class Taken:
    """One capture.

    Attributes
    ----------
    pose : list of float
        As it is reported.
    profile : (N, 2)
    center_in_laser_mm : (3,)
        Where the sphere was.
    told_from_base : (4, 4)
        Base as the arm tells it there: off by all of the arm's error but the random one.
    """

    pose: list[float]
    profile: FloatArray
    center_in_laser_mm: FloatArray
    told_from_base: FloatArray


def drawn_place(plan: Plan, rng: np.random.Generator) -> FloatArray:
    """Return where in the laser's frame (3,) a capture is meant to see the sphere's centre."""
    y = rng.uniform(*plan.offset) * plan.radius_mm * (1.0 if plan.one_side else rng.choice([-1.0, 1.0]))
    x = rng.uniform(-plan.lateral_mm, plan.lateral_mm)
    return np.array([x, y, rng.uniform(plan.near_mm, plan.far_mm)])


def take(
    arm: Arm,
    scanner: Mounted,
    rotation: FloatArray,
    place: FloatArray,
    centers: tuple[FloatArray, FloatArray],
    k: int,
    rng: np.random.Generator,
) -> Taken:
    """Return a capture by a flange turned so (3, 3); `centers`: where the ball is thought to be, and is."""
    plan, tool, (thought, there) = arm.plan, scanner.carrier_from_laser, centers
    aimed = tool[:3, :3] @ place + tool[:3, 3]
    still = scanner.on == "base"
    commanded = pose(rotation, aimed - rotation @ thought if still else thought - rotation @ aimed)
    led = arm.led_to(commanded, k, rng)
    own = turn(rng.standard_normal(3) * plan.orientation_rad)
    reached = pose(led[:3, :3] @ own, led[:3, 3] + rng.standard_normal(3) * plan.position_mm)
    ball = reached[:3, :3] @ there + reached[:3, 3] if still else there
    profile, in_laser = looks(plan, tool if still else reached @ tool, ball, k, rng)
    return Taken(pose_numbers(commanded), profile, in_laser, commanded @ back(led))


def looks(
    plan: Plan, base_from_laser: FloatArray, ball: FloatArray, k: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return the profile (N, 2) of a ball at its place in base (3,), and that place in the scanner's frame."""
    laser_from_base = back(base_from_laser @ plan.mounting(k))
    in_laser = laser_from_base[:3, :3] @ ball + laser_from_base[:3, 3]
    return _profile(plan, in_laser, rng), in_laser


def _profile(plan: Plan, center: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the columns (N, 2), x and z, that show the sphere, and what else is in view."""
    circle = np.sqrt(max(plan.radius_mm**2 - center[1] ** 2, 1e-3))
    edge = circle * np.sin(np.deg2rad(plan.arc_deg))
    x = plan.pitch_mm * np.arange(np.ceil((center[0] - edge) / plan.pitch_mm), (center[0] + edge) / plan.pitch_mm)
    dx = x - center[0]
    off = center[1] - plan.sheet(x)
    height = np.sqrt(np.maximum(plan.radius_mm**2 - off**2 - dx**2, 1e-9))
    cosine = height / plan.radius_mm
    radius = plan.radius_mm + plan.surface(np.arccos(np.clip(cosine, -1, 1)), rng)
    radius = radius + plan.point_mm * plan.noise(len(x), rng)
    z = center[2] - np.sqrt(np.maximum(radius**2 - off**2 - dx**2, 0.0))
    points = plan.scanner(np.column_stack([x, z]), rng)
    if plan.background is not None:
        points = plan.background(points, center, circle, rng)
    return points


def profile_csv(points: FloatArray) -> bytes:
    """Return a profile's file."""
    lines = [f"{x:.5f},{z:.5f}" for x, z in points.tolist()]
    return "\n".join(["x_mm,z_mm", *lines, ""]).encode()
