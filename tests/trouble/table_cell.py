"""A troubled turntable: the sphere on it, at angles and mountings."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calib_core.simulation.motion import FloatArray, pose, turn
from tests.trouble.cell import NOMINAL, Arm, Mounted, Plan, Trouble, drawn_place, looks, take

Rng = np.random.Generator
MOUNTS = ("low", "high")
_EIGHT_DEG = tuple(45.0 * k for k in range(8))
_LOW_MM = (0.0, 24.0)
"""Heights at which a sphere of 40 mm meets light that lies flat, all around."""
_BEFORE_MM = 190.0


@dataclass(eq=False)
class TablePlan(Plan):
    """What a trouble may change before a session with a table is taken; lengths in mm, angles in rad.

    Attributes
    ----------
    angles_deg : tuple of float
        Where the table is sent, in turn, for each mounting.
    heights_mm : tuple of float
        One mounting of the sphere at each, above the first one's.
    arm_mm : float
        The sphere's distance from the axis.
    reach_rad : float
        How far the scanner tilts, per component, while the table turns.
    encoder_rad : float
        Standard deviation of the encoder's own random error.
    encoder : callable
        Angle as it is reported, rng → angle that the table has turned by, beside the random error.
    play_mm : float
        Standard deviation per axis of the sphere's place at each stop: a bearing's play.
    wobble : callable
        Angle → how the axis leans there (3,), a small rotation vector in the table's frame.
    slip : callable
        Capture's number among the table's, its mounting → the sphere's shift on the table (3,).
    table_at : callable
        Capture's number among the table's, its mounting, number of captures → the table's shift in base (3,).
    table_radius_mm : float or None
        Of the sphere on the table, where it is another one.
    read : callable
        Angles as reported, in degrees, and mountings' labels, rng → the same as somebody wrote them down.
    """

    angles_deg: tuple[float, ...] = _EIGHT_DEG
    heights_mm: tuple[float, ...] = (0.0, 160.0)
    arm_mm: float = 90.0
    reach_rad: float = 0.3
    encoder_rad: float = 5e-5
    encoder: Callable[[float, Rng], float] = lambda angle, rng: angle
    play_mm: float = 0.0
    wobble: Callable[[float], FloatArray] = lambda angle: np.zeros(3)
    slip: Callable[[int, int], FloatArray] = lambda k, mount: np.zeros(3)
    table_at: Callable[[int, int, int], FloatArray] = lambda k, mount, count: np.zeros(3)
    table_radius_mm: float | None = None
    read: Callable[[list[float], list[str], Rng], None] = lambda angles, mounts, rng: None
    told_table: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TableTrouble(Trouble):
    """One class of trouble of a cell with a turntable: what it changes is a `TablePlan`."""


@dataclass(frozen=True, eq=False)
class OnTable:
    """Captures of spheres on a table.

    Attributes
    ----------
    scanners : list of Mounted
        Those that took them, in turn.
    told : list of dict
        What is recorded of each: table_deg, mount, and the pose where the robot carries the scanner.
    profiles : list of (N, 2)
    told_from_base : (4, 4)
        Base as the arm tells it there.
    """

    scanners: list[Mounted]
    told: list[dict[str, Any]]
    profiles: list[FloatArray]
    told_from_base: FloatArray


def drawn_table(rng: Rng) -> FloatArray:
    """Return base_from_turntable (4, 4), its x by the rule."""
    leaning = turn([*rng.uniform(-0.03, 0.03, 2), 0.0])
    return by_the_rule(pose(leaning, np.array([1000.0, -250.0, 440.0]) + rng.uniform(-60, 60, 3)))


def before(table: FloatArray) -> FloatArray:
    """Return where a scanner (4, 4) stands so that its light, nearly level, meets what turns on a table."""
    level = turn([0.0, 0.0, 0.5]) @ turn([0.0, -np.pi / 2, 0.0]) @ turn([0.0, 0.0, np.pi / 2])
    rotation = level @ turn([0.02, -0.01, 0.015])
    light = np.array([0.0, 0.0, max(_LOW_MM) / 2])
    return table @ pose(rotation, light - _BEFORE_MM * rotation[:, 2])


def by_the_rule(table: FloatArray) -> FloatArray:
    """Return a frame (4, 4) turned about its z so that x lies in the plane of z and base's x."""
    z = table[:3, 2]
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x = x / np.sqrt(x @ x)
    rotation = np.array([x, np.cross(z, x), z], dtype=float).T
    return pose(rotation, table[:3, 3])


def on_table(plan: TablePlan, arm: Arm, scanners: list[Mounted], table: FloatArray, rng: Rng) -> OnTable:
    """Return the captures on the table, scanners in turn; one that stands still has the heights in its light."""
    plan = replace(plan, radius_mm=plan.table_radius_mm or plan.radius_mm)
    arm = replace(arm, plan=plan)
    azimuths = rng.uniform(-np.pi, np.pi, len(plan.heights_mm))
    mounts = [m for m in range(len(plan.heights_mm)) for _ in plan.angles_deg]
    angles_deg = [angle for _ in plan.heights_mm for angle in plan.angles_deg]
    first = plan.shifts + plan.tilts
    found = OnTable(scanners, [], [], np.eye(4))
    true: list[FloatArray] = []
    told: list[FloatArray] = []
    for k, (angle_deg, mount) in enumerate(zip(angles_deg, mounts, strict=True)):
        scanner = scanners[k % len(scanners)]
        height = min(plan.heights_mm[mount], max(_LOW_MM)) if scanner.on == "base" else plan.heights_mm[mount]
        stands = np.array([plan.arm_mm * np.cos(azimuths[mount]), plan.arm_mm * np.sin(azimuths[mount]), height])
        sent = float(np.deg2rad(angle_deg))
        turned = plan.encoder(sent, rng) + plan.encoder_rad * float(rng.standard_normal())
        thought = table[:3, :3] @ (turn([0.0, 0.0, sent]) @ stands) + table[:3, 3]
        inside = turn(plan.wobble(turned)) @ turn([0.0, 0.0, turned]) @ (stands + plan.slip(k, mount))
        there = table[:3, :3] @ (inside + plan.play_mm * rng.standard_normal(3)) + table[:3, 3]
        there = there + plan.table_at(k, mount, len(mounts))
        if scanner.on == "base":
            profile, in_laser = looks(plan, scanner.carrier_from_laser, there, first + k, rng)
            found.profiles.append(profile)
            # Else the table, mirrored at the plane of light, would do as well.
            found.told.append({} if k else {"side": int(np.sign(in_laser[1]))})
            continue
        rotation = NOMINAL @ turn(rng.uniform(-plan.reach_rad, plan.reach_rad, 3))
        taken = take(arm, scanner, rotation, drawn_place(plan, rng), (thought, there), first + k, rng)
        found.profiles.append(taken.profile)
        found.told.append({"pose": taken.pose})
        true.append(there)
        told.append(taken.told_from_base[:3, :3] @ there + taken.told_from_base[:3, 3])
    labels = [MOUNTS[m] for m in mounts]
    plan.read(angles_deg, labels, rng)
    for one, angle_deg, label in zip(found.told, angles_deg, labels, strict=True):
        one |= {"table_deg": angle_deg, "mount": label}
    return replace(found, told_from_base=rigid(np.array(true), np.array(told))) if true else found


def rigid(true: FloatArray, told: FloatArray) -> FloatArray:
    """Return the move (4, 4) that brings places (N, 3) nearest to others (Kabsch)."""
    middles = true.mean(axis=0), told.mean(axis=0)
    u, _, vt = np.linalg.svd((told - middles[1]).T @ (true - middles[0]))
    rotation = np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt, dtype=float)
    return pose(rotation, middles[1] - rotation @ middles[0])
