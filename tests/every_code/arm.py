"""Rows of the arm: small arms before a tracker, joints beside poses, poses that were reached twice."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from calib_core.causes.flange import flange_findings
from calib_core.chain.observations import SphereObservation
from calib_core.findings import Finding
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.verdict import lag_findings
from tests.arm_cell import simulate_arm
from tests.every_code.captures import by_arm
from tests.every_code.made import Case, tool_of
from tests.every_code.tcp import of_sigmas, right


def of_arm(size: float = 1.0, errors: str | None = None, turned: bool = False, untold: int = 0) -> Case:
    """What is found of an arm before a tracker; `turned`: its second joint is counted the other way.

    `untold`: so many captures have no joints.
    """

    def found() -> Iterable[Finding]:
        told = simulate_arm("small", 1, 15, size=size, errors=errors, held=0).session.to_json()
        for capture in told["captures"] if turned else []:
            capture["joints_deg"][1] *= -1
        for capture in told["captures"][:untold]:
            del capture["joints_deg"]
        return solve_stage(Session.model_validate(told), "tcp", lambda _name: b"").findings

    return found


def at_pose(*places_mm: tuple[float, float]) -> Case:
    """Return what is said of captures of a ball, each of a flange and the ball's centre so far along x."""
    flat = 1e-6 * np.eye(3)
    seen = [
        SphereObservation(
            f"p{k}",
            RigidTransform.of(np.eye(3), np.array([flange, 0.0, 0.0]), "base", "tool0"),
            "cloud",
            np.zeros((0, 3)),
            np.array([center, 0.0, 200.0]),
            flat,
        )
        for k, (flange, center) in enumerate(places_mm)
    ]
    return lambda: lag_findings(seen, replace(right().noise.sigmas, position_mm=0.02))


def flange(tool_mm: float = 0.0, mixed: int = 0) -> Case:
    """Return what is said of an arm's poses of a tool so long, some captures with the joints of another."""

    def case() -> Iterable[Finding]:
        session = by_arm(tool_mm)
        some = session.captures[:mixed]
        joints = [c.joints_deg for c in (*some[1:], *some[:1])]
        others = [c.model_copy(update={"joints_deg": of}) for c, of in zip(some, joints, strict=True)]
        return flange_findings(session.cell, [*others, *session.captures[mixed:]])

    return case


CASES: dict[str, tuple[Case, Case]] = {
    "arm-errors-worth-it": (of_arm(), of_arm(size=0.0)),
    "arm-errors-applied": (of_arm(errors="apply"), of_arm(size=0.0, errors="apply")),
    "arm-errors-not-better": (of_arm(size=0.0, errors="apply"), of_arm(errors="apply")),
    "arm-errors-without-joints": (of_arm(errors="apply", untold=1), of_arm(untold=1)),
    "joints-read-otherwise": (of_arm(turned=True), of_arm()),
    "arm-lengths-off": (tool_of("arms: poses 0.5 % too long"), tool_of("arms: clean")),
    "arm-less-true-than-told": (of_sigmas(position_mm=0.08), of_sigmas(position_mm=0.07)),
    "lag-not-checked": (at_pose((0, 0), (0, 0), (50, 0)), at_pose((0, 0), (50, 0), (0, 0))),
    "poses-repeat": (at_pose((0, 0), (50, 0), (0, 0.08)), at_pose((0, 0), (50, 0), (0, 0.09))),
    "arm-lags": (at_pose((0, 0), (50, 0), (0, 0.09)), at_pose((0, 0), (50, 0), (0, 0.08))),
    "poses-lag": (tool_of("arms: lags by 0.3 mm along its path"), tool_of("arms: lag of 0.2 mm, any direction")),
    "poses-not-of-the-flange": (flange(tool_mm=5.1), flange(tool_mm=4.9)),
    "joints-contradict-poses": (flange(mixed=4), flange(mixed=3)),
}
