"""An arm that errs carries a scanner before a still ball, as its captures are advised."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.captures.measure import measure_capture
from calib_core.frames import RigidTransform
from calib_core.guidance.planner import Situation
from calib_core.guidance.prior import situation_of
from calib_core.records import Capture, Session
from calib_core.simulation.motion import FloatArray
from tests.arm_cell import ARM_KINDS, SimulatedArm, nominal_flange

SIGMA_MM = 0.02
_DOWN_DEG = {False: (0.0, 30.0, 10.0, 20.0, 50.0, 30.0), True: (0.0, -70.0, 80.0, -100.0, -90.0, 0.0)}


@dataclass(frozen=True, eq=False)
class AdvisedArm:
    """A scanner on the flange of an arm as it is, `tool` (4, 4), before a ball at (3,) in base."""

    session: Session
    arm: SimulatedArm
    tool: FloatArray
    ball: FloatArray
    seed: int

    def told(self, **robot: Any) -> Session:
        """Return the session with other things told of its robot."""
        record = self.session.model_dump(exclude_none=True, by_alias=True)
        record["cell"]["robot"] |= robot
        return Session.model_validate(record)


def advised_arm(kind: str, seed: int) -> AdvisedArm:
    """Return an arm of a kind with the first capture of its session, from where all others are turned."""
    rng, made = np.random.default_rng([seed, 371]), ARM_KINDS[kind]
    arm = SimulatedArm.drawn(made, 1.0, rng)
    joints = np.array(_DOWN_DEG[made.rows[0][1] > 0])
    flange, tool = nominal_flange(made, np.deg2rad(joints)), np.eye(4)
    tool[:3, :3] = RigidTransform.of([0.2, -0.1, 0.6], [0, 0, 0], "tool0", "laser").rotation
    tool[:3, 3] = [60.0, -40.0, 80.0]
    ball = (flange @ tool @ [5.0, 5.0, 215.0, 1.0])[:3]
    names = "a_mm", "alpha_deg", "d_mm", "theta_deg"
    robot = {"arm": {"joints": [dict(zip(names, row, strict=True)) for row in made.rows]}, "errors": "apply"}
    record = {
        "format": "scancell-session/1",
        "name": f"simulated {kind} arm, advised",
        "cell": {
            "pose_convention": "matrix",
            "sphere_diameter_mm": 30.0,
            "scanner": {
                "kind": "center", "point_sigma_mm": SIGMA_MM,
                "field_of_view": {"near_mm": 150, "far_mm": 250, "near_width_mm": 100},
            },
            "robot": robot,
            "limits": {"tilt_deg": 35.0, "turn_deg": 60.0},
            "nominal": {"base_from_tool0": flange.tolist(), "tool0_from_laser": tool.tolist()},
        },
        "captures": [],
    }  # fmt: skip
    cell = AdvisedArm(Session.model_validate(record), arm, tool, ball, seed)
    return replace(cell, session=with_capture(cell, cell.session, joints))


def with_capture(cell: AdvisedArm, session: Session, joints_deg: FloatArray) -> Session:
    """Return the session with one more capture."""
    count = len(session.captures)
    rng = np.random.default_rng([cell.seed, 372, count])
    true = cell.arm.flange(np.deg2rad(joints_deg), 0.0, np.sign(rng.normal(size=6))) @ cell.tool
    seen = true[:3, :3].T @ (cell.ball - true[:3, 3]) + rng.normal(0, SIGMA_MM, 3)
    told = nominal_flange(cell.arm.kind, np.deg2rad(joints_deg)).ravel().tolist()
    taken = Capture.model_validate(
        {
            "id": f"p{count + 1:03d}", "step": "tcp", "kind": "center", "center_mm": seen.tolist(),
            "pose": told, "joints_deg": joints_deg.tolist(),
        }
    )  # fmt: skip
    return session.model_copy(update={"captures": [*session.captures, taken]})


def joints_nearest(cell: AdvisedArm, flange: FloatArray, near_deg: FloatArray) -> FloatArray:
    """Return joints, deg, that come nearest to a flange, by the simulation's own forward model."""
    from scipy.optimize import least_squares

    def off(joints: FloatArray) -> FloatArray:
        return ((nominal_flange(cell.arm.kind, joints) - flange)[:3] * [300.0, 300.0, 300.0, 1.0]).ravel()

    return np.rad2deg(least_squares(off, np.deg2rad(near_deg), xtol=1e-12, ftol=1e-14).x)


def situation(session: Session) -> Situation:
    """Return what is known before the next capture."""
    measured = [measure_capture(session, one, lambda _name: b"") for one in session.captures]
    found = situation_of(session, measured, {})
    assert found is not None
    return found
