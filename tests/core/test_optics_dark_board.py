"""Frames of the stripe alone: the dark board's place comes from another frame, or from the robot's pose."""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.errors import MotionError
from calib_core.frames import RigidTransform
from calib_core.optics.hand_eye import solve_hand_eye
from calib_core.records import Measured, Session
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.simulation import SimulatedSession
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import run

Rendered = Callable[[str, int], SimulatedSession]
Solved = Callable[[str, int], tuple[CameraResult, LaserPlaneResult]]

TOOL0_FROM_CAMERA = RigidTransform.of([0.3, -0.2, 1.1], [40.0, -75.0, 60.0], "tool0", "camera")
BASE_FROM_BOARD = RigidTransform.of([0.1, 3.0, 0.2], [850.0, -120.0, 35.0], "base", "board")


def frames(
    seed: int, count: int, position_mm: float = 0.0, turning_rad: float = 0.0
) -> tuple[list[RigidTransform], list[RigidTransform]]:
    """Robot poses as reported, and the boards as the camera has them at poses that err."""
    rng = np.random.default_rng(seed)
    robots, boards = [], []
    for _ in range(count):
        board = RigidTransform.of(rng.uniform(-0.4, 0.4, 3), [*rng.uniform(-20, 20, 2), 250], "camera", "board")
        robot = BASE_FROM_BOARD @ (TOOL0_FROM_CAMERA @ board).inverse()
        error = np.concatenate([rng.normal(0, turning_rad, 3), rng.normal(0, position_mm, 3)])
        robots.append(robot)
        boards.append((robot.perturbed(error) @ TOOL0_FROM_CAMERA).inverse() @ BASE_FROM_BOARD)
    return robots, boards


def test_hand_and_eye_are_exact_without_noise() -> None:
    found = solve_hand_eye(*frames(1, 6))
    np.testing.assert_allclose(found.tool0_from_camera.difference(TOOL0_FROM_CAMERA), 0, atol=1e-8)
    np.testing.assert_allclose(found.base_from_board.difference(BASE_FROM_BOARD), 0, atol=1e-8)


def test_hand_and_eye_and_what_they_predict_err_as_stated() -> None:
    whole, predicted = [], []
    for seed in range(60):
        robots, boards = frames(seed, 11, 0.05, 2e-4)
        found = solve_hand_eye(robots[:10], boards[:10], 0.05, 2e-4)
        error = np.concatenate(
            [
                found.tool0_from_camera.difference(TOOL0_FROM_CAMERA),
                found.base_from_board.difference(BASE_FROM_BOARD),
            ]
        )
        whole.append(error @ np.linalg.solve(found.covariance[:12, :12], error))
        told = found.predict(robots[10])
        off = told.camera_from_board.difference(boards[10])
        predicted.append(off @ np.linalg.solve(told.covariance + told.common @ told.common.T, off))
    # Means of 60 χ² of 12 and of 6 degrees; the sigmas only ever grow, which makes them a little smaller.
    assert 10.0 < np.mean(whole) < 13.3
    assert 4.6 < np.mean(predicted) < 6.9


def test_a_frame_with_a_wrong_robot_pose_is_left_out() -> None:
    robots, boards = frames(3, 12, 0.05, 2e-4)
    robots[4] = robots[4].perturbed([0, 0, 0, 0, 3.0, 0])
    found = solve_hand_eye(robots, boards, 0.05, 2e-4)
    assert found.rejected == (4,)
    off = found.tool0_from_camera.difference(TOOL0_FROM_CAMERA)
    assert off @ np.linalg.solve(found.covariance[:6, :6], off) < 22.5  # χ² of six, 99.9 %
    assert np.sqrt(np.diag(found.covariance)[3:6]).max() < 0.5


def test_turns_about_one_axis_do_not_tell() -> None:
    robots, boards = frames(4, 8)
    about_z = [RigidTransform.of([0, 0, 0.2 * k], robots[0].translation_mm, "base", "tool0") for k in range(8)]
    seen = [(r @ TOOL0_FROM_CAMERA).inverse() @ BASE_FROM_BOARD for r in about_z]
    with pytest.raises(MotionError, match="axes that are not parallel"):
        solve_hand_eye(about_z, seen)
    with pytest.raises(MotionError, match="at least 4 robot poses"):
        solve_hand_eye(robots[:3], boards[:3])


def plane_nees(simulated: SimulatedSession, plane: LaserPlaneResult) -> float:
    truth = simulated.truth["plane_in_camera"]
    error = np.array(
        [
            *(np.array(plane.plane_in_camera.normal) - truth["normal"]),
            plane.plane_in_camera.distance_mm - truth["distance_mm"],
        ]
    )
    return float(error @ np.linalg.pinv(np.array(plane.plane_covariance), rcond=1e-10, hermitian=True) @ error)


def solved(simulated: SimulatedSession, session: Session | None = None) -> tuple[CameraResult, LaserPlaneResult]:
    results = run(session or simulated.session, simulated.files.__getitem__)
    camera, plane = results["camera"], results["laser-plane"]
    assert isinstance(camera, CameraResult)
    assert isinstance(plane, LaserPlaneResult)
    return camera, plane


@pytest.fixture(scope="module")
def solved_cell(rendered: Rendered) -> Solved:
    """Results of a simulated cell by scenario and seed, solved once."""
    return cache(lambda scenario, seed: solved(rendered(scenario, seed)))


@pytest.mark.parametrize(
    ("scenario", "captures", "normal_deg", "distance_mm"),
    [("laser-plane-beside-lit", 8, 0.02, 0.02), ("laser-plane-dark", 12, 0.03, 0.1)],
)
def test_the_stripe_alone_gives_the_plane(
    scenario: str,
    captures: int,
    normal_deg: float,
    distance_mm: float,
    rendered: Rendered,
    solved_cell: Solved,
) -> None:
    errors = []
    for seed in range(2):
        simulated = rendered(scenario, seed)
        camera, plane = solved_cell(scenario, seed)
        assert camera.verdict == "pass" or "stripe alone" not in " ".join(camera.warnings)
        truth = simulated.truth["plane_in_camera"]
        turned = np.cross(plane.plane_in_camera.normal, truth["normal"])
        assert np.rad2deg(np.linalg.norm(turned)) < normal_deg
        assert abs(plane.plane_in_camera.distance_mm - truth["distance_mm"]) < distance_mm
        assert sum(row.used for row in plane.residuals) >= captures - 1
        errors.append(plane_nees(simulated, plane))
    assert 0.2 < np.mean(errors) < 9.0  # two χ² of 3 degrees, 99.5 %: 0.26 to 9.3


@pytest.fixture(scope="module")
def beside(rendered: Rendered) -> SimulatedSession:
    return rendered("laser-plane-beside-lit", 1)


def without_poses(simulated: SimulatedSession, **named: str) -> Session:
    captures = [
        c.model_copy(update={"pose": None, "board_of": named.get(c.id)}) for c in simulated.session.captures
    ]
    return simulated.session.model_copy(update={"captures": captures})


def test_the_frame_with_the_lit_board_can_be_named(beside: SimulatedSession, solved_cell: Solved) -> None:
    dark = [c.id for c in beside.session.captures if c.step == "laser-plane"]
    _, by_pose = solved_cell("laser-plane-beside-lit", 1)
    _, by_name = solved(beside, without_poses(beside, **{name: f"c{name[1:]}" for name in dark}))
    assert by_name.plane_in_camera == by_pose.plane_in_camera


def test_a_dark_board_of_which_nothing_tells_is_named_with_what_to_do(beside: SimulatedSession) -> None:
    session = without_poses(beside, l01="c01", l02="c02", l03="c03", l04="c04")
    session = session.model_copy(
        update={
            "captures": [
                c.model_copy(update={"pose": [0, 0, 0, 1, 0, 0, 0]}) if c.id == "l05" else c
                for c in session.captures
            ]
        }
    )
    _, plane = solved(beside, session)
    reasons = {row.capture: row.reason or "" for row in plane.residuals if not row.used}
    assert set(reasons) == {"l05", "l06", "l07", "l08"}
    assert "board_of" in reasons["l05"]
    assert "cell.board.fixed" in reasons["l05"]


def test_what_comes_in_says_where_the_board_is_taken_from(beside: SimulatedSession) -> None:
    dark = next(c for c in beside.session.captures if c.step == "laser-plane")
    seen = measure_capture(beside.session, dark, beside.files.__getitem__)
    assert seen.verdict == "pass"
    assert "lit board at the same robot pose" in (seen.reason or "")
    named = dark.model_copy(update={"board_of": "c01"})
    seen = measure_capture(beside.session, named, beside.files.__getitem__)
    assert seen.reason == "The stripe alone: the board is taken from c01."


def test_a_lit_board_that_is_not_found_is_no_dark_one(beside: SimulatedSession) -> None:
    dark = next(c for c in beside.session.captures if c.step == "laser-plane")
    blank = cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes()
    seen = measure_capture(beside.session, dark, {dark.files[0]: blank}.__getitem__)
    assert seen.verdict == "fail"
    assert "a blank frame, grey 90 to 90" in (seen.reason or "")


def test_the_guide_says_that_a_fixed_board_may_be_dark(rendered: Rendered) -> None:
    whole = rendered("laser-plane-dark", 1).session
    lit = [capture for capture in whole.captures if capture.step == "camera"]
    session = whole.model_copy(update={"captures": lit})
    views = [Measured(capture=c.id, kind=c.kind, verdict="pass") for c in lit]
    done = {"camera": {"verdict": "pass"}}
    assert "may be dark" in guide(session, views, done).current.instruction
