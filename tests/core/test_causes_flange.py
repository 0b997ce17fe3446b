"""Poses of a tool or a frame, not of the flange: named by a known arm's joints, and brought back by Apply."""

from typing import Any

import numpy as np
import pytest

from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.causes.apply import applied, changes_for
from calib_core.frames import RigidTransform
from calib_core.records import Session, parse_session
from calib_core.robots import to_pose
from calib_core.stages.pipeline import run
from calib_core.stages.tcp.record import TcpResult

_SCANNER = RigidTransform.of([0.2, -0.3, 0.1], [40.0, -60.0, 120.0], "tool0", "laser")
_TOOL = RigidTransform.of([0.1, 0.4, -0.6], [12.0, 5.0, 180.0], "tool0", "laser")
_FRAME = RigidTransform.of([0.0, 0.1, 0.8], [300.0, -200.0, 50.0], "base", "turntable")
_HALF_TURN = RigidTransform.of([0.0, 0.0, np.pi], [0.0, 0.0, 0.0], "base", "turntable")
"""ROS's base_link, or the controller's base."""
_SPHERE = np.array([500.0, 100.0, 200.0])


def session_of(tool: RigidTransform | None = None, frame: RigidTransform | None = None) -> Session:
    """A session of centres whose poses are of a tool in a frame, by an arm whose joints are known."""
    rng = np.random.default_rng(5)
    captures: list[dict[str, Any]] = []
    for number in range(14):
        joints = (np.array([10.0, -80.0, 95.0, -100.0, 85.0, 20.0]) + rng.uniform(-35, 35, 6)).tolist()
        flange = flange_of_joints(NAMED_ARMS["ur5e"], joints)
        err = np.concatenate([rng.normal(0, 1e-4, 3), rng.normal(0, 0.03, 3)])
        seen = (flange.perturbed(err) @ _SCANNER).inverse().apply(_SPHERE)
        matrix = flange.matrix if tool is None else flange.matrix @ tool.matrix
        matrix = matrix if frame is None else frame.inverse().matrix @ matrix
        captures.append(
            {"id": f"c{number:02d}", "step": "tcp", "kind": "center", "center_mm": seen.round(4).tolist()}
            | {"pose": to_pose("kuka", RigidTransform(matrix, "base", "tool0")), "joints_deg": joints}
        )
    captures.append({**captures[0], "id": "s01", "step": "scan", "kind": "cloud", "files": ["s.ply"]})
    captures[-1].pop("joints_deg")
    cell = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0, "robot": {"arm": "ur5e"}}
    return parse_session({"format": "scancell-session/1", "name": "joints", "cell": cell, "captures": captures})


def solved(session: Session) -> TcpResult:
    result = run(session, {}.__getitem__, "tcp")["tcp"]
    assert isinstance(result, TcpResult)
    return result


@pytest.mark.parametrize(
    ("tool", "frame", "of"), [(_TOOL, None, "tool"), (None, _FRAME, "frame"), (_TOOL, _HALF_TURN, "both")]
)
def test_it_is_named_and_brought_back(tool: RigidTransform | None, frame: RigidTransform | None, of: str) -> None:
    session = session_of(tool, frame)
    found = solved(session)
    assert found.verdict == "warn"
    assert [one.values["of"] for one in found.findings if one.code == "poses-not-of-the-flange"] == [of]
    (cause,) = found.causes
    assert cause.kind == "not-the-flange"
    (evidence,) = cause.evidence
    assert (evidence.before or 0) > 50
    assert (evidence.after or 9) < 0.1
    changes = changes_for(session, cause)
    assert "s01" in changes.captures  # a scan of the same tool and frame, without joints
    mended, undo = applied(session, changes)
    after = solved(mended)
    assert after.causes == []
    np.testing.assert_allclose(np.array(after.tool0_from_laser), _SCANNER.matrix, atol=0.2)
    np.testing.assert_allclose(after.sphere_center_in_base_mm, _SPHERE, atol=0.2)
    assert applied(mended, undo)[0].to_json() == session.to_json()


def test_poses_of_the_flange_have_no_such_cause() -> None:
    assert solved(session_of()).causes == []


def test_scans_of_another_tool_are_left_as_they_are() -> None:
    record = session_of(_TOOL).to_json()
    for capture in record["captures"]:
        capture["active_tool"] = 9 if capture["id"] == "s01" else 3
    session = parse_session(record)
    assert "s01" not in changes_for(session, solved(session).causes[0]).captures
