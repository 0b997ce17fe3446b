"""Each function of the library on arrays alone: the answer is what the session's own files give."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

import calib_core as cc
from calib_core.simulation import SimulatedSession

Rendered = Callable[[str, int], SimulatedSession]


def grey(simulated: SimulatedSession, step: str) -> list[np.ndarray | list[np.ndarray]]:
    """The step's frames as H×W arrays; a pair (lit, stripe) as a list of two."""
    found: list[np.ndarray | list[np.ndarray]] = []
    for capture in simulated.session.captures:
        if capture.step == step:
            data = [np.frombuffer(simulated.files[name], np.uint8) for name in capture.files]
            images = [np.asarray(cv2.imdecode(each, cv2.IMREAD_UNCHANGED)) for each in data]
            found.append(images if len(images) > 1 else images[0])
    return found


def test_camera_and_plane_of_light_from_frames(rendered: Rendered) -> None:
    simulated = rendered("frames-tcp", 5)
    cell, boards = simulated.session.cell, grey(simulated, "camera")
    camera = cc.calibrate_camera(cell, boards)
    true = np.array(simulated.truth["camera"]["camera_matrix"])
    assert camera.camera_matrix[0][0] == pytest.approx(true[0, 0], rel=0.004)
    plane = cc.calibrate_laser_plane(cell, grey(simulated, "laser-plane"), camera_frames=boards)
    off = np.cross(plane.plane_in_camera.normal, simulated.truth["plane_in_camera"]["normal"])
    assert np.rad2deg(np.linalg.norm(off)) < 0.05
    assert "verdict" in plane._repr_html_()
    with pytest.raises(cc.CalibrationError, match="uint8 or uint16"):
        cc.calibrate_camera(cell, [np.zeros((48, 64))])


def test_a_part_is_merged_and_its_calibration_checked() -> None:
    session, truth = cc.simulate("cell", 1)
    of_scan = [capture for capture in session.captures if capture.step == "scan"][:4]
    scans = [cc.scan_points(session, capture) for capture in of_scan]
    poses, angles = [capture.pose for capture in of_scan], [capture.table_deg for capture in of_scan]
    known = cc.Known(tool0_from_laser=truth["tool0_from_laser"], base_from_turntable=truth["base_from_turntable"])
    cell = session.cell.model_copy(
        update={"known": known, "merge": session.cell.merge.model_copy(update={"mesh": "none"})}
    )
    merged = cc.merge_scans(cell, scans, poses, angles)
    away = np.linalg.norm(merged.points_mm - np.array(truth["ball_center_in_turntable_mm"]), axis=1)
    assert len(merged.points_mm) == merged.points > 1000
    off_ball = np.abs(away - truth["ball_diameter_mm"] / 2)
    assert (off_ball < 0.5).sum() > 500
    assert np.median(off_ball[off_ball < 2.0]) < 0.2
    with pytest.raises(cc.CalibrationError, match="4 poses, one a scan"):
        cc.merge_scans(cell, scans, poses[:3], angles)


def test_captures_that_no_calibration_saw_verify_one() -> None:
    session, truth = cc.simulate("tcp-clouds", 3)
    scans = [cc.scan_points(session, capture) for capture in session.captures]
    poses = [capture.pose for capture in session.captures]
    checked = cc.verify(session.cell, scans, poses, np.array(truth["tool0_from_laser"]))
    assert checked.verdict in {"pass", "warn"}
    wrong = np.array(truth["tool0_from_laser"])
    wrong[:3, 3] += [4.0, 0.0, 0.0]
    assert cc.verify(session.cell, scans, poses, wrong).verdict == "fail"
    assert checked.held_out_scatter_rms_mm < 3 * checked.expected_scatter_rms_mm
