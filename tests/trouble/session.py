"""The session of a cell that has a trouble, whatever stands in it: its captures, files and truth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import FloatArray, pose
from tests.trouble.cell import (
    Arm,
    Mounted,
    Plan,
    Scanners,
    Taken,
    Trouble,
    drawn_tool,
    mounted,
    of_still_balls,
    profile_csv,
    seen_by,
)
from tests.trouble.table_cell import TablePlan, TableTrouble, before, by_the_rule, drawn_table, on_table

TOLD: dict[str, Any] = {
    "robot": {"position_sigma_mm": 0.03, "orientation_sigma_deg": 0.0057},
    "scanner": {"kind": "profile", "point_sigma_mm": 0.02},
}
"""What the makers of robot and scanner state: true of a clean cell, and all the same told where it is not."""
_TOLD_ANGLE_DEG = 0.003


@dataclass(frozen=True, eq=False)
class Troubled:
    """A session with its files and truth.

    Attributes
    ----------
    tool0_from_laser : (4, 4)
        The scanner's pose; that of one that stands still is in base, as the arm tells base there.
    seen_in_laser_mm : (3,)
        Where the still sphere was seen.
    scanner : callable
        Points (N, 2) that a right scanner gives → those of this one, without its noise.
    laser_from_files : (4, 4)
        The frame in which the files count.
    sphere_in_base_mm : (3,)
    too_long : float
        By what share the arm tells its lengths too long.
    other : (4, 4) or None
        The second scanner's pose.
    mounting : callable
        Capture's number → how the scanner sits otherwise there (4, 4).
    base_from_turntable : (4, 4) or None
        The table's z is its mean axis, pointing up, the origin the centre of the first mounting's circle, x across
        z in the plane of z and base's x; in base as the arm tells it about the table, which is what scans are put
        together by.
    true_base_from_turntable : (4, 4) or None
        Where the table stands in truth, whatever the arm tells; x by the same rule in the true base.
    """

    session: Session
    files: dict[str, bytes]
    tool0_from_laser: FloatArray
    seen_in_laser_mm: FloatArray
    scanner: Callable[[FloatArray], FloatArray]
    laser_from_files: FloatArray
    sphere_in_base_mm: FloatArray
    too_long: float
    other: FloatArray | None
    mounting: Callable[[int], FloatArray]
    base_from_turntable: FloatArray | None
    true_base_from_turntable: FloatArray | None


def troubled(trouble: Trouble, seed: int, told: bool = False, scanners: Scanners = "one") -> Troubled:
    """Return a session of a cell that has a trouble, all drawn from a seed; `told`: with the makers' sigmas."""
    has_table = isinstance(trouble, TableTrouble)
    rng = np.random.default_rng([seed, 911 if has_table else 907])
    plan = TablePlan() if has_table else Plan()
    trouble.change(plan, rng)
    tool, table = drawn_tool(rng), drawn_table(rng) if has_table else None
    ball = np.array([1000.0, 150.0, 350.0]) + rng.uniform(-60, 60, 3)
    cell = mounted(scanners, tool, ball, rng, None if table is None else before(table))
    plan.shifts, plan.tilts, plan.alike = (len(cell) * n for n in (plan.shifts, plan.tilts, plan.alike))
    tilts = (
        np.zeros(3) if k < plan.shifts else rng.uniform(-plan.tilt_rad, plan.tilt_rad, 3)
        for k in range(plan.shifts + plan.tilts)
    )
    arm = Arm(plan)
    taken = of_still_balls(arm, cell, tilts if has_table else [*tilts], rng)  # a seed keeps its cell
    told_bases = [told_base(one, taken[n :: len(cell)]) for n, one in enumerate(cell)]
    poses, profiles = [one.pose for one in taken], [one.profile for one in taken]
    plan.book(poses, profiles, rng)
    captures = [_record(f"p{k:03d}", "tcp", k, cell, pose=pose) for k, pose in enumerate(poses)]
    base_from_turntable = table
    if isinstance(plan, TablePlan) and table is not None:
        on_it = on_table(plan, arm, [one for one in cell if one.on == "tool0"] or cell, table, rng)
        captures += [
            _record(f"t{k:03d}", "turntable", k, on_it.scanners, **one) for k, one in enumerate(on_it.told)
        ]
        profiles += on_it.profiles
        told_from_base = told_bases[0] if cell[0].on == "base" else on_it.told_from_base
        base_from_turntable = by_the_rule(told_from_base @ table)
    lasers = [moved @ one.carrier_from_laser for moved, one in zip(told_bases, cell, strict=True)]
    return Troubled(
        session=Session.model_validate(
            {"name": trouble.name, "cell": cell_record(plan, cell, told), "captures": captures}
        ),
        files={one["files"][0]: profile_csv(profile) for one, profile in zip(captures, profiles, strict=True)},
        tool0_from_laser=lasers[0],
        seen_in_laser_mm=np.mean([one.center_in_laser_mm for one in taken[:: len(cell)]], axis=0),
        scanner=seen_by(plan),
        laser_from_files=plan.laser_from_files,
        sphere_in_base_mm=cell[0].ball,
        too_long=plan.too_long,
        other=lasers[1] if len(lasers) > 1 else None,
        mounting=plan.mounting,
        base_from_turntable=base_from_turntable,
        true_base_from_turntable=table,
    )


def cell_record(plan: Plan, scanners: Sequence[Mounted], told: bool) -> dict[str, Any]:
    """Return what is said of a cell; `told`: with the makers' sigmas."""
    cell: dict[str, Any] = {
        "pose_convention": "abb",
        "sphere_diameter_mm": plan.told_diameter_mm or 2 * plan.radius_mm,
        "scanner": {"kind": "profile"},
    }
    if plan.told_diameter_sigma_mm is not None:
        cell["sphere_diameter_sigma_mm"] = plan.told_diameter_sigma_mm
    cell |= plan.told | (TOLD if told else {})
    if isinstance(plan, TablePlan):
        cell["turntable"] = plan.told_table | ({"angle_sigma_deg": _TOLD_ANGLE_DEG} if told else {})
    if scanners[0].on == "base":
        cell["arrangement"] = "sphere-on-robot"
    if len(scanners) > 1:
        own = cell.pop("scanner")
        cell["scanners"] = {one.name: own | ({"on": "base"} if one.on == "base" else {}) for one in scanners}
    return cell


def _record(name: str, step: str, number: int, cell: Sequence[Mounted], **told: Any) -> dict[str, Any]:
    """Return the record of a step's capture; scanners of a cell take turns."""
    scanner = cell[number % len(cell)].name
    return {
        "id": name,
        "step": step,
        "kind": "profile",
        "files": [f"captures/{name}.csv"],
        **({"scanner": scanner} if scanner else {}),
        **told,
    }


def told_base(scanner: Mounted, taken: Sequence[Taken]) -> FloatArray:
    """Return base (4, 4) as the arm tells it where it holds a ball before a scanner that stands still."""
    if scanner.on == "tool0":
        return np.eye(4)
    laser, frames = scanner.carrier_from_laser, [one.told_from_base for one in taken]
    middle = laser[:3, :3] @ np.mean([one.center_in_laser_mm for one in taken], axis=0) + laser[:3, 3]
    u, _, vt = np.linalg.svd(np.mean([frame[:3, :3] for frame in frames], axis=0))
    moved = np.mean([frame[:3, :3] @ middle + frame[:3, 3] for frame in frames], axis=0)
    return pose(u @ vt, moved - u @ vt @ middle)
