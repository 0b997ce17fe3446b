"""A check says what each step's captures lack, one line a cause, and what of it blocks solving."""

from typing import Any

import cv2
import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.records import Finding, Session, parse_session
from calib_core.review.check import check_lines, check_session
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage
from calib_core.steps import capture_steps

CELL = simulate("turntable", 2)
LEAST = {step.name: step.least for step in capture_steps()}


def session_of(captures: list[dict[str, Any]], **cell: Any) -> Session:
    data = CELL.session.to_json()
    return parse_session({**data, "cell": {**data["cell"], **cell}, "captures": captures})


def captures_of(*steps: str, most: int = 99) -> list[dict[str, Any]]:
    captures = CELL.session.to_json()["captures"]
    return [c for step in steps for c in [one for one in captures if one["step"] == step][:most]]


def checked(session: Session) -> list[Finding]:
    return check_session(session, CELL.files.__getitem__)


def errors(found: list[Finding]) -> list[str]:
    return [finding.where for finding in found if finding.severity == "error"]


def test_nothing_blocks_a_good_cell_and_its_notes_are_one_a_cause() -> None:
    found = checked(session_of(captures_of("tcp", "turntable")))
    assert errors(found) == []
    middles = [finding for finding in found if finding.code == "captures-weak"]
    assert 0 < len(middles) <= 2  # one of the TCP's captures, one of the table's
    assert all("sphere's middle" in finding.text for finding in middles)
    others = [finding.code for finding in found if finding not in middles]
    assert len(others) == len(set(others))


@pytest.mark.parametrize("step", ["tcp", "turntable"])
def test_as_many_captures_are_asked_for_as_the_solver_needs(step: str) -> None:
    known = {} if step == "tcp" else {"known": {"tool0_from_laser": np.eye(4).tolist()}}
    enough = session_of(captures_of(step, most=LEAST[step]), **known)
    too_few = session_of(captures_of(step, most=LEAST[step] - 1), **known)
    assert f"captures: {step}" not in errors(checked(enough))
    assert f"captures: {step}" in errors(checked(too_few))
    with pytest.raises(MotionError, match=f"at least {LEAST[step]} captures"):
        solve_stage(too_few, step, CELL.files.__getitem__)


def test_a_turntable_without_the_tool_is_blocked_and_boards_alone_are_not() -> None:
    turning = captures_of("turntable")
    still = [{**one, "pose": turning[0]["pose"]} for one in turning]
    assert errors(checked(session_of(still))) == ["captures"]
    assert errors(checked(session_of(turning))) == []  # seen from many poses, it tells where the scanner is
    assert errors(checked(session_of([]))) == ["captures"]

    def blank(name: str) -> bytes:
        return cv2.imencode(".png", np.full((80, 120), 90 + int(name[-5]), np.uint8))[1].tobytes()

    frames = [
        {"id": f"f{k}", "step": "camera", "kind": "frame", "files": [f"captures/f{k}.png"]} for k in range(4)
    ]
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25.0}
    found = check_session(session_of(frames, board=board), blank)
    assert errors(found) == ["captures: camera"]
    warned = [finding for finding in found if finding.severity == "warning"]
    assert [(one.code, one.captures) for one in warned] == [("captures-show-nothing", ["f0", "f1", "f2", "f3"])]
    assert any(finding.code == "no-tcp-captures-yet" for finding in found)
    lines = check_lines(found)
    assert [line.where for line in lines if line.level == "warning"] == ["f0–f3"]


def test_a_wrong_convention_and_swapped_columns_are_doubted_before_anything_is_solved() -> None:
    assert not [one for one in checked(session_of(captures_of("tcp"))) if "look at one place" in one.text]
    doubts = [
        one
        for one in checked(session_of(captures_of("tcp"), pose_convention="quaternion-xyzw"))
        if one.where == "cell.pose_convention"
    ]
    assert len(doubts) == 1
    assert "if they are written as 'quaternion-wxyz'" in doubts[0].text
