"""A laser tracker's points become `center` captures of a scanner that stands still, and solve to the truth."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import calib_core as cc
from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.library.new_session import new_session
from calib_core.poses.numbers import to_pose
from calib_core.recognition.recognised import recognise
from calib_core.recognition.taken import GivenFile
from calib_core.recognition.tracker_points import centers_in
from calib_core.records import parse_session
from calib_core.stages.pipeline import solve_stage
from server.cli import main

RNG = np.random.default_rng(37)
_MATRIX = np.eye(4)
_MATRIX[:3, :3] = Rotation.from_euler("xyz", [2, -3, 140], degrees=True).as_matrix()
_MATRIX[:3, 3] = [2100, -900, 300]
BASE_FROM_TRACKER = RigidTransform(_MATRIX, "base", "laser")
TARGET_IN_TOOL0_MM = np.array([40.0, -25.0, 110.0])
SIGMA_MM = 0.015
U95_MM = 1.96 * SIGMA_MM


def _poses(count: int) -> list[np.ndarray]:
    matrices = []
    for _ in range(count):
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_rotvec(RNG.normal(0, 0.6, 3)).as_matrix()
        matrix[:3, 3] = RNG.uniform([600, -400, 300], [1200, 400, 900])
        matrices.append(matrix)
    return matrices


POSES = _poses(16)
TRACKER_FROM_BASE = np.linalg.inv(BASE_FROM_TRACKER.matrix)
POINTS_MM = [
    (TRACKER_FROM_BASE @ pose @ [*TARGET_IN_TOOL0_MM, 1])[:3] + RNG.normal(0, SIGMA_MM, 3) for pose in POSES
]


def leica(unit: str = "mm", header: bool = True) -> str:
    """A CSV whose axes are named in the order z, x, y, beside a U95 of each point."""
    factor = {"mm": 1.0, "m": 1e-3, "in": 1 / 25.4}[unit]
    stated = f" [{unit}]" if header else ""
    rows = [
        f"P{k},2026-11-20 10:{k:02d}:00,{z * factor:.9f},{x * factor:.9f},{y * factor:.9f},{U95_MM * factor:.9f}"
        for k, (x, y, z) in enumerate(POINTS_MM, start=1)
    ]
    return "\n".join([f"Name,Time,Z{stated},X{stated},Y{stated},U95{stated}", *rows]) + "\n"


def spatial_analyzer(unit: str = "Millimeters") -> str:
    rows = [f"A::Robot::P{k} {x:.6f} {y:.6f} {z:.6f}" for k, (x, y, z) in enumerate(POINTS_MM, start=1)]
    return "\n".join(["// SpatialAnalyzer", f"// Units: {unit}", *rows]) + "\n"


def poses_text() -> str:
    rows = [to_pose("kuka", RigidTransform(pose, "base", "tool0")) for pose in POSES]
    named = [f"P{k}," + ",".join(f"{v:.7f}" for v in row) for k, row in reversed(list(enumerate(rows, start=1)))]
    return "\n".join(["name,X,Y,Z,A,B,C", *named]) + "\n"


def lay(folder: Path, **files: str) -> Path:
    folder.mkdir()
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text)
    return folder


@pytest.mark.parametrize(
    "text",
    [leica(), leica("m"), leica("in"), leica().replace(",", ";").replace(".", ","), spatial_analyzer()],
    ids=["mm", "m", "in", "decimal commas", "SpatialAnalyzer"],
)
def test_a_trackers_points_and_the_controllers_poses_solve_to_where_the_tracker_stands(
    tmp_path: Path, text: str
) -> None:
    folder = lay(tmp_path / "in", tracker_csv=text, poses_csv=poses_text())
    made = new_session(folder, convention="kuka")
    assert made.missing == ()
    assert {file["name"]: file["taken_for"] for file in made.files} == {
        "tracker.csv": "centers",
        "poses.csv": "poses",
    }
    session = cc.load(made.folder)
    assert (session.cell.arrangement, session.cell.scanner.kind) == ("sphere-on-robot", "center")
    told = session.cell.scanner.point_sigma_mm
    assert told == pytest.approx(SIGMA_MM, rel=1e-5) if "U95" in text else told is None
    by_name = {capture.id: capture for capture in session.captures}
    for k, point in enumerate(POINTS_MM, start=1):
        np.testing.assert_allclose(by_name[f"P{k}"].center_mm, point, atol=1e-5)
    result = session.run("tcp")["tcp"]
    error = BASE_FROM_TRACKER.difference(RigidTransform.from_rounded(result.base_from_laser, "base", "laser"))
    assert np.linalg.norm(error[3:]) < 0.2  # at 2.3 m
    assert float(error @ np.linalg.solve(np.array(result.covariance), error)) < 22.5  # 99.9 %
    # Where the tracker sees its target, out of any plane of light, the answer is far surer than where it stands.
    seen, spread = np.array(result.workpiece.point_in_laser_mm), np.array(result.workpiece.covariance)
    np.testing.assert_allclose(seen, np.mean(POINTS_MM, axis=0), atol=0.1)
    found = RigidTransform.from_rounded(result.base_from_laser, "base", "laser")
    off = found.apply(seen) - BASE_FROM_TRACKER.apply(seen)
    assert float(off @ np.linalg.solve(spread, off)) < 16.3  # 99.9 %
    assert np.sqrt(np.linalg.eigvalsh(spread)[-1]) < 0.03


def test_a_tracker_far_away_is_judged_where_it_sees_its_target() -> None:
    farther, rng = np.linalg.inv(BASE_FROM_TRACKER.matrix), np.random.default_rng(38)
    farther[:3, 3] += [9000.0, -4000.0, 2000.0]
    captures = [
        {
            "id": f"P{k}", "step": "tcp", "kind": "center", "pose": pose.ravel().tolist(),
            "center_mm": ((farther @ pose @ [*TARGET_IN_TOOL0_MM, 1])[:3] + rng.normal(0, 0.3, 3)).tolist(),
        }
        for k, pose in enumerate(POSES)
    ]  # fmt: skip
    cell = {"pose_convention": "matrix", "arrangement": "sphere-on-robot", "scanner": {"point_sigma_mm": 0.3}}
    record = parse_session({"format": "scancell-session/1", "cell": cell, "captures": captures}, "session")
    result = solve_stage(record, "tcp", lambda _name: b"")
    assert np.sqrt(np.trace(np.array(result.covariance)[3:, 3:])) > 5.0  # where it stands, ten metres away
    assert np.sqrt(np.linalg.eigvalsh(np.array(result.workpiece.covariance))[-1]) < 0.5
    assert not {"tool-position-undetermined", "tool-position-weak"} & {one.code for one in result.findings}


def test_a_unit_is_never_taken_in_silence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = lay(tmp_path / "in", tracker_csv=leica("m", header=False), poses_csv=poses_text())
    with pytest.raises(InputError, match=r"tracker\.csv.*unit"):
        new_session(folder, tmp_path / "none")
    assert not (tmp_path / "none").exists()
    assert main(["new", str(folder), "--convention", "kuka", "--unit", "m"]) == 0
    assert "16 points of a laser tracker in m" in capsys.readouterr().out
    centers = [capture.center_mm for capture in cc.load(tmp_path / "in-session").captures]
    np.testing.assert_allclose(sorted(centers), sorted(map(tuple, POINTS_MM)), atol=1e-5)
    stated = centers_in(leica("m"), "tracker.csv", "mm")
    assert stated is not None
    assert stated.unit == "m"


@pytest.mark.parametrize(
    "text",
    [
        "X,Y,Z\n1.0,2.0,3.0\n4.0,5.0,6.0\n",
        "measured by laser tracker\nX,Y,Z,A,B,C\n1.0,2.0,3.0,4.0,5.0,6.0\n",
        "Point Easting Northing Height\nP1 1.0 2.0 3.0\n",
        "! conveyor tracker\nPTP P1\n",
    ],
    ids=["a cloud", "poses", "a survey", "a program"],
)
def test_what_is_no_trackers_stays_what_it_is(text: str) -> None:
    assert centers_in(text, "file") is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Name,X [mm],Y [mm],Z [mm],U95\nP1,1.0,2.0,3.0,0.03\nP2,1.0,2.0\n", "line 3"),
        ("Name,X [mm],Y [mm],Z [mm],U95\nP1,1.0,n/a,3.0,0.03\n", "'n/a' in line 2"),
        ("// SpatialAnalyzer\nP1 1.0 2.0 3.0 0.01\n", "line 2"),
    ],
)
def test_a_row_that_is_damaged_or_open_to_doubt_is_named(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        centers_in(text, "file.csv")


def test_points_beside_scans_of_another_scanner_are_left_aside_and_named(tmp_path: Path) -> None:
    scan = "x_mm,z_mm\n" + "".join(f"{k / 10},{100 - (k - 50) ** 2 / 800:.3f}\n" for k in range(100))
    made = new_session(lay(tmp_path / "in", tracker_csv=leica(), scan_csv=scan, poses_csv=poses_text()))
    tracker = next(file for file in made.files if file["name"] == "tracker.csv")
    assert (tracker["taken_for"], made.captures) == ("nothing", 1)
    assert "a folder of their own" in tracker["why"]


def test_the_uncertainty_of_each_axis_counts_and_not_the_points_own_beside_it() -> None:
    header = "Point,X [mm],Y [mm],Z [mm],U95 X [mm],U95 Y [mm],U95 Z [um],U95 [mm]"
    found = centers_in(f"{header}\nP1,1.0,2.0,3.0,0.0196,0.0196,19.6,0.05\n", "file.csv")
    assert found is not None
    assert (found.unit, found.points[0].center_mm) == ("mm", (1.0, 2.0, 3.0))
    assert found.sigma_mm == pytest.approx(0.01)


def joints_of(names: str) -> tuple[str, str, list[list[float]]]:
    """A tracker's points, a table of joints of an IRB 120 whose columns are named so, and the joints, deg."""
    arm, rng = arm_of("irb120"), np.random.default_rng(39)
    joints: list[list[float]] = rng.uniform(-60, 60, (12, 6)).round(3).tolist()
    flanges = [flange_of_joints(arm, row).matrix for row in joints]
    points = [(TRACKER_FROM_BASE @ flange @ [*TARGET_IN_TOOL0_MM, 1])[:3] for flange in flanges]
    rows = [f"P{k},{x:.5f},{y:.5f},{z:.5f},0.03" for k, (x, y, z) in enumerate(points, start=1)]
    tracker = "\n".join(["Name,X [mm],Y [mm],Z [mm],U95 [mm]", *rows]) + "\n"
    factor = np.deg2rad(1) if "rad" in names else 1.0
    told = [f"P{k}," + ",".join(f"{v * factor:.7f}" for v in row) for k, row in enumerate(joints, start=1)]
    return tracker, "\n".join([f"name,{names}", *told]) + "\n", joints


@pytest.mark.parametrize(
    "names",
    ["J1,J2,J3,J4,J5,J6", "A1,A2,A3,A4,A5,A6", ",".join(f"joint_{k} [rad]" for k in range(1, 7))],
    ids=["J", "KUKA's", "rad"],
)
def test_joints_make_the_poses_of_a_trackers_points_where_the_arm_is_told(tmp_path: Path, names: str) -> None:
    tracker, table, joints = joints_of(names)
    folder = lay(tmp_path / "in", tracker_csv=tracker, joints_csv=table)
    untold = new_session(folder, tmp_path / "untold")
    assert next(file for file in untold.files if file["name"] == "joints.csv")["taken_for"] == "nothing"
    assert untold.missing
    made = new_session(folder, tmp_path / "told", arm="irb120")
    assert made.missing == ()
    session = cc.load(made.folder)
    by_name = {capture.id: capture for capture in session.captures}
    for k, row in enumerate(joints, start=1):
        np.testing.assert_allclose(np.array(by_name[f"P{k}"].joints_deg, dtype=float), row, atol=1e-4)
    result = session.run("tcp")["tcp"]
    np.testing.assert_allclose(result.sphere_center_in_tool0_mm, TARGET_IN_TOOL0_MM, atol=0.05)


def test_joints_in_a_file_of_their_own_go_with_the_poses_of_their_names(tmp_path: Path) -> None:
    tracker, table, joints = joints_of("A1 [deg],A2,A3,A4,A5,A6")
    flanges = [flange_of_joints(arm_of("irb120"), row) for row in joints]
    rows = [
        f"P{k}," + ",".join(f"{v:.6f}" for v in to_pose("kuka", flange)) for k, flange in enumerate(flanges, 1)
    ]
    poses = "\n".join(["name,X,Y,Z,A,B,C", *reversed(rows)]) + "\n"
    made = new_session(
        lay(tmp_path / "in", tracker_csv=tracker, poses_csv=poses, axes_csv=table), convention="kuka"
    )
    assert made.missing == ()
    why = next(file["why"] for file in made.files if file["name"] == "axes.csv")
    assert why == "Joints of 12 poses, taken with poses.csv."
    by_name = {capture.id: capture for capture in cc.load(made.folder).captures}
    assert [by_name[f"P{k}"].joints_deg for k in range(1, 13)] == joints


def test_what_is_open_of_the_order_is_said_in_a_sentence(tmp_path: Path) -> None:
    scan = "".join(f"{k / 10},{100 - (k - 50) ** 2 / 800:.3f}\n" for k in range(100))
    folder = lay(tmp_path / "in", scan_csv=f"x_mm,z_mm\n{scan}", poses_csv=poses_text())
    assert "1 measurements, 16 poses, in their order" in " ".join(new_session(folder, convention="kuka").notes)


def test_a_page_is_shown_the_file_and_offered_no_file_a_point() -> None:
    files = [GivenFile("tracker.csv", leica().encode()), GivenFile("poses.csv", poses_text().encode())]
    shown = recognise(files, convention="kuka").to_json()
    assert shown["files"][0]["reason"] == "centers-sure"
    assert shown["pairs"] == [{"file": None, "pose": pose} for pose in reversed(range(16))]


def test_joints_beside_poses_tell_the_convention(tmp_path: Path) -> None:
    """Two conventions that list rx ry rz look alike to a tracker's points; the arm's joints tell them apart."""
    joints = np.random.default_rng(3).uniform(-100, 100, (12, 6)).round(4)
    lines = ["name,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg," + ",".join(f"j{n}_deg" for n in range(1, 7))]
    points = ["Name,X [mm],Y [mm],Z [mm],U95 [mm]"]
    for k, row in enumerate(joints.tolist()):
        flange = flange_of_joints(arm_of("ur10e"), row)
        numbers = [*to_pose("yaskawa", flange), *row]
        lines.append(f"P{k}," + ",".join(f"{value:.4f}" for value in numbers))
        seen = TRACKER_FROM_BASE @ flange.matrix @ [*TARGET_IN_TOOL0_MM, 1]
        points.append(f"P{k}," + ",".join(f"{value:.4f}" for value in seen[:3]) + ",0.03")
    (tmp_path / "in").mkdir()
    (tmp_path / "in/poses.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "in/leica.csv").write_text("\n".join(points) + "\n")
    made = new_session(tmp_path / "in", tmp_path / "without")
    assert any("not certain" in one for one in made.missing)
    made = new_session(tmp_path / "in", tmp_path / "with", arm="ur10e")
    assert made.missing == ()
    record = parse_session(json.loads((tmp_path / "with/session.json").read_text()), "session.json")
    assert record.cell.pose_convention == "yaskawa"


def test_poses_of_a_tracker_s_file_are_refused_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "leica.csv").write_text(leica())
    with pytest.raises(InputError, match="a laser tracker"):
        cc.read_poses(tmp_path / "leica.csv")
