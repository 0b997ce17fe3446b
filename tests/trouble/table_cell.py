"""One session of a troubled turntable: the sphere beside it as in `cell`, then on it, at angles and mountings."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import FloatArray, pose, turn
from tests.trouble.cell import (
    NOMINAL,
    TOLD,
    Arm,
    Plan,
    cell_record,
    drawn_place,
    drawn_tool,
    profile_csv,
    seen_by,
    take,
)

Rng = np.random.Generator
MOUNTS = ("low", "high")
_EIGHT_DEG = tuple(45.0 * k for k in range(8))
_TOLD_ANGLE_DEG = 0.003


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
class TableTrouble:
    """One class of trouble of a cell with a turntable; `clean` as of `Trouble`."""

    name: str
    change: Callable[[TablePlan, Rng], None]
    clean: bool = False


@dataclass(frozen=True, eq=False)
class TroubledTable:
    """A session with its files and truth.

    Attributes
    ----------
    tool0_from_laser, base_from_turntable : (4, 4)
        The table's z is its mean axis, pointing up, the origin the centre of the first mounting's circle, x across
        z in the plane of z and base's x; in base as the arm tells it about the table, which is what scans are put
        together by.
    scanner : callable
        As of `Troubled`.
    true_base_from_turntable : (4, 4)
        Where the table stands in truth, whatever the arm tells; x by the same rule in the true base.
    """

    session: Session
    files: dict[str, bytes]
    tool0_from_laser: FloatArray
    base_from_turntable: FloatArray
    scanner: Callable[[FloatArray], FloatArray]
    true_base_from_turntable: FloatArray


def troubled_table(trouble: TableTrouble, seed: int, told: bool = False) -> TroubledTable:
    """Return a session of a cell with a troubled table, all drawn from a seed; `told`: with the makers' sigmas."""
    rng = np.random.default_rng([seed, 911])
    plan = TablePlan()
    trouble.change(plan, rng)
    tool, table = drawn_tool(rng), _drawn_table(rng)
    center = np.array([1000.0, 150.0, 350.0]) + rng.uniform(-60, 60, 3)
    arm, files, captures = Arm(plan), {}, []
    for k in range(plan.shifts + plan.tilts):
        tilt = np.zeros(3) if k < plan.shifts else rng.uniform(-plan.tilt_rad, plan.tilt_rad, 3)
        taken = take(arm, tool, NOMINAL @ turn(tilt), drawn_place(plan, rng), (center, center), k, rng)
        name = f"captures/p{k:03d}.csv"
        files[name] = profile_csv(taken.profile)
        captures.append({"id": f"p{k:03d}", "step": "tcp", "kind": "profile", "files": [name], "pose": taken.pose})
    plan.radius_mm, radius_mm = plan.table_radius_mm or plan.radius_mm, plan.radius_mm
    on_table, told_from_base = _on_table(plan, arm, tool, table, files, rng)
    captures += on_table
    plan.radius_mm = radius_mm
    cell = cell_record(plan) | (TOLD if told else {})
    turntable = plan.told_table | ({"angle_sigma_deg": _TOLD_ANGLE_DEG} if told else {})
    record = {"name": trouble.name, "cell": {**cell, "turntable": turntable}, "captures": captures}
    return TroubledTable(
        Session.model_validate(record), files, tool, _by_the_rule(told_from_base @ table), seen_by(plan), table
    )


def _drawn_table(rng: Rng) -> FloatArray:
    """Return base_from_turntable (4, 4) by the rule of `TroubledTable`."""
    leaning = turn([*rng.uniform(-0.03, 0.03, 2), 0.0])
    return _by_the_rule(pose(leaning, np.array([1000.0, -250.0, 440.0]) + rng.uniform(-60, 60, 3)))


def _by_the_rule(table: FloatArray) -> FloatArray:
    """Return a frame (4, 4) turned about its z so that x lies in the plane of z and base's x."""
    z = table[:3, 2]
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x = x / np.sqrt(x @ x)
    rotation = np.array([x, np.cross(z, x), z], dtype=float).T
    return pose(rotation, table[:3, 3])


def _on_table(
    plan: TablePlan, arm: Arm, tool: FloatArray, table: FloatArray, files: dict[str, bytes], rng: Rng
) -> tuple[list[dict[str, Any]], FloatArray]:
    """Return the captures on the table, and base (4, 4) as the arm tells it there; add their files."""
    azimuths = rng.uniform(-np.pi, np.pi, len(plan.heights_mm))
    angles_deg = [angle for _ in plan.heights_mm for angle in plan.angles_deg]
    mounts = [m for m in range(len(plan.heights_mm)) for _ in plan.angles_deg]
    first = plan.shifts + plan.tilts
    captures: list[dict[str, Any]] = []
    true: list[FloatArray] = []
    told: list[FloatArray] = []
    for k, (angle_deg, mount) in enumerate(zip(angles_deg, mounts, strict=True)):
        stands = np.array(
            [plan.arm_mm * np.cos(azimuths[mount]), plan.arm_mm * np.sin(azimuths[mount]), plan.heights_mm[mount]]
        )
        sent = float(np.deg2rad(angle_deg))
        turned = plan.encoder(sent, rng) + plan.encoder_rad * float(rng.standard_normal())
        thought = table[:3, :3] @ (turn([0.0, 0.0, sent]) @ stands) + table[:3, 3]
        inside = turn(plan.wobble(turned)) @ turn([0.0, 0.0, turned]) @ (stands + plan.slip(k, mount))
        there = table[:3, :3] @ (inside + plan.play_mm * rng.standard_normal(3)) + table[:3, 3]
        there = there + plan.table_at(k, mount, len(mounts))
        rotation = NOMINAL @ turn(rng.uniform(-plan.reach_rad, plan.reach_rad, 3))
        taken = take(arm, tool, rotation, drawn_place(plan, rng), (thought, there), first + k, rng)
        name = f"captures/t{k:03d}.csv"
        files[name] = profile_csv(taken.profile)
        captures.append({"id": f"t{k:03d}", "step": "turntable", "kind": "profile", "files": [name]})
        captures[-1]["pose"] = taken.pose
        true.append(there)
        told.append(taken.told_from_base[:3, :3] @ there + taken.told_from_base[:3, 3])
    labels = [MOUNTS[m] for m in mounts]
    plan.read(angles_deg, labels, rng)
    for capture, angle_deg, label in zip(captures, angles_deg, labels, strict=True):
        capture |= {"table_deg": angle_deg, "mount": label}
    return captures, _rigid(np.array(true), np.array(told))


def _rigid(true: FloatArray, told: FloatArray) -> FloatArray:
    """Return the move (4, 4) that brings places (N, 3) nearest to others (Kabsch)."""
    middles = true.mean(axis=0), told.mean(axis=0)
    u, _, vt = np.linalg.svd((told - middles[1]).T @ (true - middles[0]))
    rotation = np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt, dtype=float)
    return pose(rotation, middles[1] - rotation @ middles[0])
