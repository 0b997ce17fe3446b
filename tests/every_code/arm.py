"""Rows of the arm's room: small arms before a tracker."""

from collections.abc import Iterable

from calib_core.findings import Finding
from calib_core.records import Session
from calib_core.stages.pipeline import solve_stage
from tests.arm_cell import simulate_arm
from tests.every_code.made import Case


def of_arm(size: float = 1.0, errors: str | None = None, turned: bool = False) -> Case:
    """What is found of an arm before a tracker; `turned`: its second joint is counted the other way."""

    def found() -> Iterable[Finding]:
        told = simulate_arm("small", 1, 15, size=size, errors=errors, held=0).session.to_json()
        for capture in told["captures"] if turned else []:
            capture["joints_deg"][1] *= -1
        return solve_stage(Session.model_validate(told), "tcp", lambda _name: b"").findings

    return found


CASES: dict[str, tuple[Case, Case]] = {
    "arm-errors-worth-it": (of_arm(), of_arm(size=0.0)),
    "arm-errors-applied": (of_arm(errors="apply"), of_arm(size=0.0, errors="apply")),
    "arm-errors-not-better": (of_arm(size=0.0, errors="apply"), of_arm(errors="apply")),
    "joints-read-otherwise": (of_arm(turned=True), of_arm()),
}
