"""Rows of the verification: figures at either side of their limits, sessions that verify a brought tool."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from calib_core.findings import Finding
from calib_core.records import LimitChange, Session, Verification
from calib_core.simulation import SimulatedSession, simulate_verify
from calib_core.simulation.verify_cell import VERIFY_SCENARIOS
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.verify.decision import Estimate, checked, decision_findings, scatter_findings
from calib_core.stages.verify.flatness import Plate
from calib_core.stages.verify.held_out import HeldOut
from calib_core.stages.verify.limits import limit_findings
from calib_core.stages.verify.record import Decision
from calib_core.stages.verify.solve import unchecked_limits
from tests.arm_cell import later_on_an_arm
from tests.every_code.made import Case
from tests.verified import brought_tool, shifted, verified_session


def decision(value_mm: float, uncertainty_mm: float = 0.1, count: int = 10) -> Case:
    """Return what is decided of a figure whose limit is 1 mm."""
    figure = checked("form", Estimate(value_mm, uncertainty_mm), 1.0, count)
    return lambda: decision_findings([figure], count)


def limit(after_mm: float) -> Case:
    """Return what is said of a limit of 1 mm that was changed after captures."""
    change = LimitChange(
        at="2026-01-01T00:00:00Z", who="x", field="tool_mm", before_mm=1.0, after_mm=after_mm, captures=4
    )
    return lambda: limit_findings(Verification(tool_mm=after_mm, changes=[change]))


def plate(turned_deg: float = 30.0, left_out: int = 0) -> Case:
    """Return what is said of a plate's captures."""
    form = Estimate(0.1, 0.01)
    return lambda: Plate(form, form, [], left_out=left_out, turned_deg=turned_deg).findings


def brought(off_mm: float, *, shuffled: bool = False, seed: int = 5, some: Iterable[int] = range(15)) -> Case:
    """Return what the verification of a brought tool says that is so far off."""

    def case() -> Iterable[Finding]:
        cell = brought_tool(seed, off_mm, shuffled)
        captures = [cell.session.captures[k] for k in some]
        session = cell.session.model_copy(update={"captures": captures})
        return solve_stage(session, "verify", cell.files.__getitem__).findings

    return case


def of_mounts(most: str, last: str) -> Case:
    """Return what the verification of a brought tool says whose last capture names a mounting of its own."""

    def case() -> Iterable[Finding]:
        cell = brought_tool(5, 0.3, False)
        *others, one = (c.model_copy(update={"mount": most}) for c in cell.session.captures)
        captures = [*others, one.model_copy(update={"mount": last})]
        session = cell.session.model_copy(update={"captures": captures})
        return solve_stage(session, "verify", cell.files.__getitem__).findings

    return case


def verify(session: Session, made: SimulatedSession) -> Iterable[Finding]:
    """Return what the verification of a session says, with the files of a simulated one."""
    return solve_stage(session, "verify", made.files.__getitem__).findings


@cache
def _beside(number: int, aside_mm: float) -> Iterable[Finding]:
    made = verified_session(5)
    one = made.session.captures[number]
    captures = [
        shifted(made.session, c, [aside_mm, aside_mm, 0.0]) if c is one else c for c in made.session.captures
    ]
    return verify(made.session.model_copy(update={"captures": captures}), made)


def beside(aside_mm: float) -> Case:
    """Return what the verification says, one pose so far beside its own."""
    return lambda: _beside(-3, aside_mm)


def on_an_arm(**since: Any) -> Case:
    """Return what the verification of a scanner on a known arm says that changed since."""

    def case() -> Iterable[Finding]:
        session = later_on_an_arm("small", 8001, "verify", errors="apply", **since)
        return solve_stage(session, "verify", lambda _name: b"").findings

    return case


def near_calibration(aside_mm: float) -> Case:
    """Return what the verification says, one capture so far beside a pose of the calibration."""

    def case() -> Iterable[Finding]:
        made = verified_session(5)
        calibrated = made.session.captures[0]
        placed = calibrated.model_copy(update={"step": "verify"})
        pose = shifted(made.session, placed, [aside_mm, 0.0, 0.0]).pose
        *others, last = made.session.captures
        return verify(
            made.session.model_copy(update={"captures": [*others, last.model_copy(update={"pose": pose})]}), made
        )

    return case


def after_poses(*, reverse: bool) -> Case:
    """Return what the verification says of an answer from captures whose poses stand in this order."""

    def case() -> Iterable[Finding]:
        made = verified_session(5)
        own = [c for c in made.session.captures if c.step == "tcp"]
        others = [c for c in made.session.captures if c.step == "verify"]
        poses = [c.pose for c in (reversed(own) if reverse else own)]
        told = [c.model_copy(update={"pose": pose}) for c, pose in zip(own, poses, strict=True)]
        return verify(made.session.model_copy(update={"captures": [*told, *others]}), made)

    return case


def scatter(factor: float, decided: Decision | None = None, *, knows: bool = True) -> Case:
    """Return what is said where 20 figures scatter so many times what is expected."""
    none, row = np.zeros((0, 3)), np.ones((7, 3))
    asked: Any = None
    found = HeldOut(none, none, row, row, none, none, none, 20 * factor**2, 20, asked)
    return lambda: scatter_findings(found, knows, decided)


def unchecked(limit_mm: float | None) -> Case:
    """Return which limits a check of the form leaves open, one of the spacing set or not."""
    form = checked("form", Estimate(0.1, 0.01), 1.0, 10)
    return lambda: unchecked_limits(Verification(form_mm=1.0, spacing_mm=limit_mm), [form], None)


@cache
def _plate_alone(flatness_mm: float | None, spheres: bool) -> Iterable[Finding]:
    made = simulate_verify(3, replace(VERIFY_SCENARIOS["verify"], tool_off_mm=0.0, of_bar=0))
    steps = {"plate", "verify"} if spheres else {"plate"}
    data = made.session.to_json()
    captures = [c for c in data["captures"] if c["step"] in steps]
    cell = {**data["cell"], "verification": {"flatness_mm": flatness_mm}}
    return verify(Session.model_validate({**data, "cell": cell, "captures": captures}), made)


def plate_alone(flatness_mm: float | None = 1.0, *, spheres: bool = False) -> Case:
    """Return what is said of a plate, alone or beside captures of a sphere."""
    return lambda: _plate_alone(flatness_mm, spheres)


CASES: dict[str, tuple[Case, Case]] = {
    "verify-fail": (decision(1.2), decision(1.05)),
    "verify-conditional-fail": (decision(1.05), decision(0.95)),
    "verify-conditional-pass": (decision(0.95), decision(0.85)),
    "verify-undecided": (decision(0.5, count=3), decision(0.5)),
    "verify-not-held-out": (near_calibration(0.09), near_calibration(0.11)),
    "verify-captures-disagree": (beside(0.7), beside(0.0)),
    "verify-seen-once": (of_mounts("ball", "other"), of_mounts("ball", "ball")),
    "verify-points-off-ball": (brought(0.3, shuffled=True), brought(1.6)),
    "verify-sides-open": (brought(0.3, seed=6, some=(3, 7)), brought(0.3, seed=6)),
    "verify-of-failed-answer": (after_poses(reverse=True), after_poses(reverse=False)),
    "verify-tool-without-uncertainty": (scatter(1.0, knows=False), scatter(1.0)),
    "verify-scatter-large": (scatter(1.4), scatter(1.3)),
    "verify-tool-moved": (on_an_arm(tool_mm=0.6), on_an_arm()),
    "joint-zero-moved": (on_an_arm(bumped_deg=[0.0, 0.0, 0.15, 0.0, 0.0, 0.0]), on_an_arm(tool_mm=1.0)),
    "verify-scatter-fails": (scatter(3.1), scatter(2.9)),
    "verify-limit-not-checked": (unchecked(0.5), unchecked(None)),
    "verify-limit-eased": (limit(2.0), limit(0.5)),
    "verify-limit-changed": (limit(0.5), limit(2.0)),
    "plate-not-turned": (plate(turned_deg=9.9), plate(turned_deg=10.1)),
    "points-beside-plate": (plate(left_out=1), plate()),
    "plate-without-limit": (plate_alone(None), plate_alone()),
    "plate-alone": (plate_alone(), plate_alone(spheres=True)),
}
