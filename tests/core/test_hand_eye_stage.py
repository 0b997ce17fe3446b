"""The board as a second opinion: camera and tool against the truth, and beside the sphere's answer."""

from typing import Any

import cv2
import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import InputError
from calib_core.exports.answer import answer_of
from calib_core.exports.export import export
from calib_core.frames import RigidTransform
from calib_core.graph.registry import STAGES
from calib_core.optics.hand_eye import HandEye
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.records import Session
from calib_core.records.evidence import Picture
from calib_core.review.answer import answer_record
from calib_core.review.cell_frames import frame_graph
from calib_core.simulation import SimulatedSession
from calib_core.stages.evidence import made_evidence, stored_evidence
from calib_core.stages.hand_eye.record import HandEyeResult
from calib_core.stages.hand_eye.solve import agreement_of, composed, hand_eye_findings
from calib_core.stages.pipeline import run, solve_stage
from tests.fixed_board_cell import FixedBoardScenario, simulate_fixed_board


@pytest.fixture(scope="module")
def made() -> SimulatedSession:
    options = FixedBoardScenario(lit=7, striped=3)
    return SimulatedSession(*simulate_fixed_board(options, "hand-eye", 3), None)


def with_tool(made: SimulatedSession, tool: Any) -> Any:
    known = made.session.cell.known.model_copy(update={"tool0_from_laser": tool})
    return made.session.model_copy(update={"cell": made.session.cell.model_copy(update={"known": known})})


@pytest.mark.thorough
def test_camera_and_board_against_the_truth_and_the_tool_beside_the_spheres(made: SimulatedSession) -> None:
    tool = made.truth["tool0_from_laser"]
    result = solve_stage(with_tool(made, tool), "hand-eye", made.files.__getitem__).to_json()
    frames = [RigidTransform.from_rounded(d["tool0_from_camera"], "tool0", "camera") for d in (result, made.truth)]
    off = frames[0].difference(frames[1])
    assert off @ np.linalg.solve(np.array(result["covariance"]), off) < 22.5  # χ² of six, 99.9 %
    assert np.linalg.norm(off[3:]) < 0.5
    # The board lies where it does; which of its corners is the first one, its detection says.
    normals = [np.array(d["base_from_board"])[:3, 2] for d in (result, made.truth)]
    assert abs(normals[0] @ normals[1]) > 1 - 1e-6
    agreement = result["agreement"]
    assert agreement["with_stage"] == "known"
    assert agreement["chance"] > 0.001
    assert agreement["shift_mm"] < 1.0
    assert result["verdict"] == "pass"
    assert len(result["residuals"]) == 10
    found = frame_graph(made.session, {"hand-eye": result}).find("camera", "tool0")
    assert found.through[0].source == "hand-eye"
    assert np.allclose((found.transform @ frames[0]).matrix, np.eye(4), atol=1e-9)
    told = [block.model_dump() for block in stored_evidence(made.session, result)]
    assert "units of both uncertainties" in str(told)


@pytest.mark.thorough
def test_a_board_on_the_flange_tells_where_a_camera_stands(made: SimulatedSession) -> None:
    # Poses inverted, the same frames are those of a board on the flange before a camera that stands still.
    convention = made.session.cell.pose_convention
    turned = [
        one.model_copy(
            update={"pose": to_pose(convention, parse_pose(convention, one.pose or [], one.id).inverse())}
        )
        for one in made.session.captures
    ]
    known = made.session.cell.known.model_copy(update={"base_from_laser": made.truth["tool0_from_laser"]})
    cell = made.session.cell.model_copy(update={"arrangement": "sphere-on-robot", "known": known})
    session = made.session.model_copy(update={"cell": cell, "captures": turned})
    solved = solve_stage(session, "hand-eye", made.files.__getitem__)
    result = solved.to_json()
    assert result["verdict"] == "pass"
    assert "tool0_from_camera" not in result
    assert result["agreement"]["with_stage"] == "known"
    assert result["agreement"]["chance"] > 0.001
    off = RigidTransform.from_rounded(result["base_from_camera"], "base", "camera").difference(
        RigidTransform.from_rounded(made.truth["tool0_from_camera"], "base", "camera")
    )
    assert off @ np.linalg.solve(np.array(result["covariance"]), off) < 30.0
    edges = {edge.name for edge in frame_graph(session, {"hand-eye": result}).edges}
    assert {"base_from_camera", "tool0_from_board"} <= edges
    assert "tool0_from_camera" not in edges
    # Where no sphere was captured this is the answer, and exported as a frame of the base.
    alone = session.model_copy(update={"cell": cell.model_copy(update={"known": type(known)()})})
    answer = answer_record(answer_of(alone, {"hand-eye": solved}))
    assert answer.base_from_laser is not None
    assert np.allclose(answer.base_from_laser.matrix, result["base_from_laser_by_board"])
    rows = export(alone, {"hand-eye": solved}, "csv")[0].decode().splitlines()
    assert [row.split(",")[:2] for row in rows[-3:]] == [
        ["base", "laser"], ["base", "camera"], ["tool0", "board"]
    ]  # fmt: skip
    kuka = export(alone, {"hand-eye": solved}, "kuka")[0].decode()
    assert "BASE_DATA[1]" in kuka
    assert "TOOL_DATA" not in kuka
    edges = {edge.name: edge.source for edge in frame_graph(alone, {"hand-eye": result}).edges}
    assert edges["base_from_laser"] == "hand-eye"


def test_how_well_the_pitch_is_known_counts(made: SimulatedSession) -> None:
    board = made.session.cell.board
    assert board is not None
    known = board.model_copy(update={"pitch_sigma_mm": 1e-5 * board.pitch_mm})
    cell = made.session.cell.model_copy(update={"board": known})
    lit = [capture for capture in made.session.captures if capture.step == "camera"]
    images = [cv2.imdecode(np.frombuffer(made.files[c.files[0]], np.uint8), cv2.IMREAD_UNCHANGED) for c in lit]
    told = cc.calibrate_hand_eye(cell, images, [c.pose for c in lit], made.truth["tool0_from_laser"])
    assert told.pitch_sigma < 1.01e-5
    assert told.pitch_factor == pytest.approx(1.0, abs=4e-5)


def test_a_board_that_is_moved_by_hand_is_refused(made: SimulatedSession) -> None:
    board = made.session.cell.board
    assert board is not None
    assert STAGES.get("hand-eye").is_wanted(made.session)
    cell = made.session.cell.model_copy(update={"board": board.model_copy(update={"fixed": False})})
    loose = made.session.model_copy(update={"cell": cell})
    assert not STAGES.get("hand-eye").is_wanted(loose)
    with pytest.raises(InputError, match="stands still"):
        solve_stage(loose, "hand-eye", made.files.__getitem__)


def test_boards_that_are_not_found_leave_it_out_and_stop_nothing(made: SimulatedSession) -> None:
    lit = [c for c in made.session.captures if c.step == "camera"]
    blank = cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes()
    files = {f"captures/again-{c.id}.png": made.files[c.files[0]] for c in lit}
    files |= {c.files[0]: blank if k > 2 else made.files[c.files[0]] for k, c in enumerate(lit)}
    by_hand = [
        c.model_copy(update={"id": f"again-{c.id}", "pose": None, "files": [f"captures/again-{c.id}.png"]})
        for c in lit
    ]
    session = made.session.model_copy(update={"captures": [*by_hand, *lit]})
    told: list[str] = []
    results = run(session, files.__getitem__, "all", lambda _fraction, what: told.append(what))
    assert list(results) == ["camera"]
    assert any(what.startswith("hand-eye is left out: ") for what in told)


def test_agreement_and_composition_by_samples() -> None:
    rng = np.random.default_rng(5)
    first = RigidTransform.of([0.3, -0.2, 0.9], [30.0, -90.0, 60.0], "tool0", "camera")
    second = RigidTransform.of([-0.1, 0.5, 0.2], [10.0, 40.0, 5.0], "camera", "laser")
    scale = np.diag([1e-4, 2e-4, 1e-4, 0.02, 0.05, 0.03])
    of_first, of_second = scale @ scale, 4 * scale @ scale
    whole, covariance = composed(first, second, of_first, of_second)
    draws = [(scale @ rng.normal(size=6), 2 * scale @ rng.normal(size=6)) for _ in range(500)]
    off = np.array([whole.difference(first.perturbed(a) @ second.perturbed(b)) for a, b in draws])
    np.testing.assert_allclose(np.sqrt(np.diag(np.cov(off.T))), np.sqrt(np.diag(covariance)), rtol=0.12)
    squares = [
        agreement_of("tcp", whole.perturbed(step), covariance, whole, np.zeros((6, 6))).distance ** 2
        for step in rng.multivariate_normal(np.zeros(6), covariance, 300)
    ]
    far = agreement_of("tcp", whole.perturbed([0, 0, 0, 3.0, 0, 0]), covariance, whole, covariance)
    assert (far.chance < 1e-6, far.with_stage) == (True, "tcp")
    assert far.sigmas[3] > 20
    assert np.mean(squares) == pytest.approx(6.0, abs=0.8)


@pytest.mark.parametrize(
    ("sigma_mm", "sigma_deg", "shift_mm", "code"),
    [
        (0.1, 0.05, 0.1, None),
        (0.1, 0.05, 0.9, "board-and-sphere-differ"),
        (2.0, 0.05, 9.0, "camera-on-flange-weak"),
        (0.1, 0.9, 0.9, "camera-on-flange-weak"),
    ],
)
def test_only_a_firm_second_opinion_that_chance_does_not_explain_contradicts(
    sigma_mm: float, sigma_deg: float, shift_mm: float, code: str | None
) -> None:
    pose = RigidTransform.of([0.3, -0.2, 0.9], [30.0, -90.0, 60.0], "tool0", "camera")
    covariance = np.diag([np.deg2rad(sigma_deg) ** 2] * 3 + [sigma_mm**2] * 3)
    found = HandEye(pose, pose, 1.0, np.zeros(0), covariance, 0.1, 1e-3)
    agreement = agreement_of("tcp", pose.perturbed([0, 0, 0, shift_mm, 0, 0]), covariance, pose, np.zeros((6, 6)))
    assert [one.code for one in hand_eye_findings(found, agreement)] == ([code] if code else [])
    assert [one.code for one in hand_eye_findings(found, None)] == ([code] if code and "weak" in code else [])


def test_frames_that_do_not_count_are_told_by_gate_with_a_picture(made: SimulatedSession) -> None:
    session, files = made.session.to_json(), dict(made.files)
    lit = [capture for capture in session["captures"] if capture["step"] == "camera"]
    files[lit[1]["files"][0]] = cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes()
    lit[4]["pose"][0] += 40.0
    moved = Session.model_validate(session)
    result = solve_stage(moved, "hand-eye", files.__getitem__)
    assert isinstance(result, HandEyeResult)
    told = {one.code: one.captures for one in result.findings}
    assert told == {"frame-not-used": [lit[1]["id"]], "view-not-used": [lit[4]["id"]]}
    unused = {row.capture: row.reason for row in result.residuals if not row.used}
    assert set(unused) == {lit[1]["id"], lit[4]["id"]}
    assert "blank frame" in str(unused[lit[1]["id"]])
    shown = [block for block in made_evidence(moved, result) if isinstance(block, Picture)]
    assert [block.capture for block in shown] == [lit[1]["id"], lit[4]["id"]]
