"""A scanner that stands still before a ball on the flange: found in base, as surely as it says."""

import json
from pathlib import Path

import numpy as np
import pytest

import calib_core as cc
from calib_core.archive.folder import save_session, to_json_bytes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.review.answer import answer_of_folder
from calib_core.review.cell_frames import session_frames
from calib_core.simulation import simulate
from calib_core.stages.guide import guide
from server.cli import main

SEEDS = 8


def off(scenario: str, seed: int) -> tuple[FloatArray, FloatArray, str]:
    session, truth = cc.simulate(scenario, seed)
    result = session.run()["tcp"]
    true = RigidTransform.from_rounded(truth["base_from_laser"], "base", "laser")
    found = RigidTransform.from_rounded(result.base_from_laser, "base", "laser")
    return true.difference(found), np.array(result.covariance), result.verdict


@pytest.mark.thorough
@pytest.mark.parametrize("scenario", ["fixed-scanner", "fixed-scanner-unknown-sigmas"])
def test_errors_are_as_large_as_they_are_said_to_be(scenario: str) -> None:
    nees: list[float] = []
    within: list[float] = []
    passed = 0
    for seed in range(SEEDS):
        error, covariance, verdict = off(scenario, seed)
        passed += verdict == "pass"
        nees.append(float(error @ np.linalg.solve(covariance, error)))
        within.append(float(np.mean(np.abs(error) < 1.96 * np.sqrt(np.diag(covariance)))))
    # The diameter is stated with ± 0.08 mm, and is right: so the mean lies below 6.
    assert 2.0 < np.mean(nees) < 6 + 2 * np.sqrt(12 / SEEDS)
    assert np.mean(within) > 0.93 - 2 * np.sqrt(0.05 * 0.95 / (6 * SEEDS))
    assert passed >= 0.7 * SEEDS


@pytest.mark.thorough
def test_a_ball_that_slipped_and_a_wrong_pose_are_left_out() -> None:
    session, truth = cc.simulate("fixed-scanner-spoiled", 3)
    result = session.run()["tcp"]
    left_out = [row.capture for row in result.residuals if not row.used]
    assert sorted(left_out) == sorted(truth["spoiled"])
    assert result.verdict == "warn"
    error, covariance, _ = off("fixed-scanner-spoiled", 3)
    assert float(error @ np.linalg.solve(covariance, error)) < 22.5


def test_its_result_answer_frames_and_exports_are_of_base() -> None:
    session, truth = cc.simulate("fixed-scanner", 5)
    result = session.run()["tcp"]
    told = json.loads(json.dumps(result.to_json()))
    assert "tool0_from_laser" not in told
    assert "sphere_center_in_base_mm" not in told
    assert np.allclose(told["sphere_center_in_tool0_mm"], truth["sphere_center_in_tool0_mm"], atol=1.0)
    (frame,) = told["frames"]
    assert (frame["into"], frame["outof"], frame["matrix"]) == ("base", "laser", told["base_from_laser"])
    answer = answer_of_folder(session.record, {"tcp": told}, session.read)
    assert answer is not None
    assert answer.tool0_from_laser is None
    assert answer.base_from_laser is not None
    assert np.allclose(answer.base_from_laser.matrix, told["base_from_laser"])
    assert answer.workpiece_sigma_mm is not None
    frames = session_frames(session.record, {"tcp": told}, asked=("base", "laser"))
    assert frames.asked is not None
    assert json.loads(session.export("json"))["base_from_laser"] == told["base_from_laser"]
    assert b"base,laser," in session.export("csv")
    assert b"BASE_DATA[1]=" in session.export("kuka")
    with pytest.raises(cc.CalibrationError, match="stands still"):
        session.export("kuka-check-move")
    known = session.record.cell.known.model_copy(update={"base_from_laser": told["base_from_laser"]})
    brought = session.record.model_copy(update={"cell": session.cell.model_copy(update={"known": known})})
    with pytest.raises(cc.CalibrationError, match=r"cell\.known"):
        cc.OpenSession(brought, session.read).run("tcp")


@pytest.mark.thorough
def test_the_command_line_goes_all_the_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulated = simulate("fixed-scanner", 6)
    folder, packed = tmp_path / "cell", tmp_path / "cell.zip"
    files = {**simulated.files, "truth.json": to_json_bytes(simulated.truth)}
    save_session(folder, simulated.session, files)
    for command in (
        ["check"], ["run"], ["answer"], ["frames"], ["next"], ["report", "--out", str(tmp_path / "report.html")],
        ["archive", "pack", "--out", str(packed)],
    ):  # fmt: skip
        words = [*command[:2], str(folder), *command[2:]] if command[0] == "archive" else [*command, str(folder)]
        assert main(words) == 0, (words, capsys.readouterr().err)
    assert "Scanner in the robot's base" in capsys.readouterr().out
    assert main(["archive", "replay", str(packed)]) == 0


def test_its_results_before_a_table_speak_of_no_tool() -> None:
    simulated = simulate("fixed-scanner-turntable", 7)
    results = cc.OpenSession(simulated.session, simulated.files.__getitem__).run()
    said = {name: [one.method, *one.warnings, *one.notes] for name, one in results.items()}
    assert "turntable" in said
    assert [(name, text) for name, texts in said.items() for text in texts if " tool" in text] == []


def test_the_guide_speaks_of_the_ball_on_the_flange() -> None:
    simulated = simulate("fixed-scanner", 7)
    session = simulated.session
    shown = [guide(session.model_copy(update={"captures": session.captures[:n]}), [], {}) for n in (0, 2, 8)]
    words = " ".join(f"{one.current.instruction} {one.current.why}" for one in shown)
    assert "the ball keeps its place on the flange" in words
    assert "Shift the ball with the flange" in words
    assert "where the ball sits on the flange" in words
    result = simulated.session.to_json() and cc.OpenSession(session, simulated.files.__getitem__).run()["tcp"]
    stale = guide(session, [], {"tcp": result}, stale={"tcp"})
    assert stale.current.instruction
