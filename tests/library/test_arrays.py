"""Each function of the library on arrays alone: the answer is what the session's own files give."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import calib_core as cc
from calib_core.robots.controller_file import FilePose
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


@pytest.mark.thorough
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


@pytest.mark.thorough
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
    assert copy.copy(merged).points == merged.points
    assert "overlap_rms_mm" in dir(merged)
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


def test_scans_and_poses_are_taken_in_every_form_in_which_one_has_them(tmp_path: Path) -> None:
    session, _ = cc.simulate("tcp", 1)
    cell = session.cell
    shown = session.captures[:3]
    scans = [cc.scan_points(session, capture) for capture in shown]
    transforms = [cc.parse_pose(cell.pose_convention, capture.pose or []) for capture in shown]
    (tmp_path / "scan.csv").write_bytes(session.read(shown[0].files[0]))
    as_kuka = [tuple(cc.to_pose("kuka", pose)) for pose in transforms]
    from_file = [FilePose(f"P{k}", pose, "kuka", None, None, 1, 0, k) for k, pose in enumerate(as_kuka)]
    reading = cc.read_scan(tmp_path / "scan.csv")
    for given in (transforms, from_file, np.array([pose.matrix for pose in transforms]), iter(transforms)):
        made = cc.make_session(cell, {"tcp": cc.Captures((scan for scan in [reading, *scans[1:]]), given)})
        for capture, own in zip(made.captures, shown, strict=True):
            np.testing.assert_allclose(capture.pose or [], own.pose or [], atol=1e-6)
            np.testing.assert_allclose(cc.scan_points(made, capture), cc.scan_points(session, own), atol=1e-6)


@pytest.mark.parametrize(
    ("scans", "angles", "said"),
    [
        (np.zeros((5, 2)), None, "a list of scans, one a pose, got one scan"),
        ("scan.csv", None, "a list of scans, one a pose, got one scan"),
        ([np.array([["a", "b"]])], None, "Give them as rows of numbers"),
        ([None], None, "got None"),
        ([np.zeros((2, 9))], None, r"shape \(2, 9\)"),
        ([np.zeros((5, 2))], ["x"], "a number in degrees"),
    ],
)
def test_what_is_no_scan_or_angle_is_told_in_words(scans: Any, angles: Any, said: str) -> None:
    captures = cc.Captures(scans, [[0.0] * 6], angles)
    with pytest.raises(cc.CalibrationError, match=said):
        cc.make_session(cc.Cell(pose_convention="kuka"), {"turntable": captures})


@pytest.mark.parametrize("calibration", [None, "tool.json", np.eye(3)])
def test_what_is_no_calibration_is_told_in_words(calibration: Any) -> None:
    with pytest.raises(cc.CalibrationError, match="need a calibration, or a 4×4 matrix, got"):
        cc.verify(cc.Cell(pose_convention="kuka"), [], [], calibration)
