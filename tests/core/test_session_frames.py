"""Raw frames in a session: camera and plane of light that were solved before serve as long as they are fresh."""

from collections.abc import Callable

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.captures.solved_optics import remembered
from calib_core.captures.stripe_frames import calibration_of, with_solved_calibration
from calib_core.guidance.part_budget import budget_at
from calib_core.records import KnownCamera, Session
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.review.cell_frames import frame_graph
from calib_core.simulation import SimulatedSession
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult

SHIFT_MM = 5.0
FOLD = 0.18  # of the ray's slope


@pytest.fixture(scope="module")
def cell(rendered: Callable[[str, int], SimulatedSession]) -> SimulatedSession:
    return rendered("frames-tcp", 7)


@pytest.fixture(scope="module")
def plane(cell: SimulatedSession) -> LaserPlaneResult:
    result = solve_stage(cell.session, "laser-plane", cell.files.__getitem__)
    assert isinstance(result, LaserPlaneResult)
    return result


def with_camera(session: Session, camera: KnownCamera) -> Session:
    known = session.cell.known.model_copy(update={"camera": camera})
    return session.model_copy(update={"cell": session.cell.model_copy(update={"known": known})})


def moved(plane: LaserPlaneResult) -> LaserPlaneResult:
    """The plane as no solver would find it here, to tell a stored result from one that is solved afresh."""
    shifted = plane.plane_in_camera.model_copy(
        update={"distance_mm": plane.plane_in_camera.distance_mm + SHIFT_MM}
    )
    return plane.model_copy(update={"plane_in_camera": shifted})


@pytest.mark.thorough
def test_a_stored_plane_serves_later_stages_until_its_captures_change(
    cell: SimulatedSession, plane: LaserPlaneResult
) -> None:
    remembered("laser-plane", plane.inputs_sha256, moved(plane))
    used = calibration_of(cell.session, cell.files.__getitem__)
    assert used.distance_mm == plane.plane_in_camera.distance_mm + SHIFT_MM
    boards = [c for c in cell.session.captures if c.step == "laser-plane"]
    fewer = cell.session.model_copy(
        update={"captures": [c for c in cell.session.captures if c.id != boards[-1].id]}
    )
    afresh = calibration_of(fewer, cell.files.__getitem__)
    assert abs(afresh.distance_mm - plane.plane_in_camera.distance_mm) < 6 * plane.distance_sigma_mm
    remembered("laser-plane", plane.inputs_sha256, plane)


@pytest.mark.thorough
def test_a_solved_calibration_in_the_cell_measures_the_sphere_as_the_boards_do(
    cell: SimulatedSession, plane: LaserPlaneResult
) -> None:
    ball = next(c for c in cell.session.captures if c.step == "tcp")
    alone = cell.session.model_copy(update={"captures": []})
    brought = with_solved_calibration(alone, {"laser-plane": plane.to_json()})
    seen = measure_capture(brought, ball, cell.files.__getitem__)
    with_boards = measure_capture(cell.session, ball, cell.files.__getitem__)
    assert seen.center_mm == pytest.approx(with_boards.center_mm, abs=1e-9)
    assert with_solved_calibration(alone, {}) == alone
    edge = frame_graph(cell.session, {"laser-plane": plane.to_json()}).find("camera", "laser").through[0]
    assert (edge.state, edge.source) == ("solved", "laser-plane")


def test_bands_of_depth_are_kept_in_the_cell() -> None:
    bands = [
        {"near_mm": 150.0 + 60 * k, "far_mm": 270.0 + 60 * k, "distortion": {"k1": -0.1 - 0.01 * k}}
        for k in (0, 1)
    ]
    cell = {
        "pose_convention": "matrix",
        "known": {
            "camera": {
                "camera_matrix": [[900, 0, 320], [0, 900, 240], [0, 0, 1]],
                "image_size": [640, 480],
                "segments": bands,
            },
            "laser_plane": {"normal": [0, 1, 0.5], "distance_mm": 100},
        },
    }
    session = Session.model_validate({"cell": cell})
    calibration = calibration_of(session, lambda _: b"")
    assert calibration.camera.model == "segmental"
    assert calibration.camera.image_size == (640, 480)
    assert [s.distortion[0] for s in calibration.camera.segments] == [-0.1, -0.11]
    pixels = np.array([[100.0, 50.0], [500.0, 400.0]])
    again = calibration.camera.project(calibration.camera_from_laser.apply(calibration.points(pixels)))
    assert np.allclose(again, pixels, atol=1e-6)


@pytest.mark.thorough
def test_a_tool_from_frames_tells_what_camera_and_plane_are_not_known_to(cell: SimulatedSession) -> None:
    result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    assert [shift.source for shift in result.optics].count("plane") == 3
    assert {part.name for part in budget_at(cell.session, {"tcp": result.to_json()}).parts} >= {"camera", "plane"}
    # They are in the tool's covariance, and are no more than that.
    moves = np.array([shift.tool for shift in result.optics])
    assert np.linalg.eigvalsh(np.array(result.covariance) - moves.T @ moves)[0] > 0
    known = result.model_dump() | {"optics": []}
    assert {part.name for part in budget_at(cell.session, {"tcp": known}).parts}.isdisjoint({"camera", "plane"})


@pytest.mark.thorough
def test_rays_beyond_the_fold_are_counted_of_the_capture_and_told_by_the_tool(
    cell: SimulatedSession, plane: LaserPlaneResult
) -> None:
    """A lens that turns back within the picture: ends of arcs have no ray, and who reads the result is told so."""
    alone = cell.session.model_copy(update={"captures": [c for c in cell.session.captures if c.step == "tcp"]})
    brought = with_solved_calibration(alone, {"laser-plane": plane.to_json()})
    camera = brought.cell.known.camera
    assert camera is not None
    lens = camera.model_copy(update={"distortion": {**camera.distortion, "k3": -1 / (7 * FOLD**6)}})
    folded = with_camera(brought, lens)
    dropped: list[int] = []
    for ball in folded.captures:
        whole = measure_capture(brought, ball, cell.files.__getitem__)
        seen = measure_capture(folded, ball, cell.files.__getitem__)
        assert whole.without_ray == 0
        assert seen.points + seen.without_ray == whole.points
        told = f"{seen.without_ray} stripe centres were dropped" in (seen.reason or "")
        assert told == (seen.without_ray > 0)
        dropped.append(seen.without_ray)
    assert 0 in dropped
    result = solve_stage(folded, "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    assert any(f"{sum(dropped)} stripe centres were dropped" in note for note in result.notes)
