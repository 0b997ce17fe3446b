"""Tables of poses and OpenCV's matrices: what the columns, the unit and the direction are is told or refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.robots import parse_pose
from calib_core.robots.backup import read_controller_files
from calib_core.robots.controller_file import ControllerFile
from calib_core.robots.file_hints import Told
from server.cli import main

QUATERNIONS = "name,x [m],y [m],z [m],qx,qy,qz,qw,table\np1,1,0,0.5,0,0,0,1,30\np2,1,0,0.6,0,0,0,1,60\n"
KUKA = "name;X;Y;Z;A;B;C\np1;1000,5;0,0;500,1;0,0;1,0;2,0\n"


def read(text: str, name: str = "a.csv", brand: str | None = None, **told: str) -> ControllerFile:
    return read_controller_files({name: text.encode()}, brand, False, Told.of(told))


def test_named_columns_with_their_unit() -> None:
    found = read(QUATERNIONS)
    assert [(p.name, p.pose, p.line, p.external) for p in found.poses] == [
        ("p1", (1000, 0, 500, 0, 0, 0, 1), 2, {"table": 30.0}),
        ("p2", (1000, 0, 600, 0, 0, 0, 1), 3, {"table": 60.0}),
    ]
    assert found.poses[0].convention == "quaternion-xyzw"
    assert "unit" not in found.poses[0].doubt


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (KUKA, {"convention": "kuka"}),
        (KUKA.split("\n", 1)[1], {"convention": "kuka", "columns": "name,x,y,z,A,B,C"}),
        ("C,B,A,Z,Y,X,note\n2,1,0,500.1,0,1000.5,good\n", {"convention": "kuka"}),
        ("2 1 0 500.1 0 1000.5 9\n", {"convention": "kuka", "columns": "c b a z y x -"}),
        ("1000.5\t0\t500.1\t0\t1\t2\n", {"convention": "kuka"}),
        ("# a comment\n1.0005;0;0.5001;0;1;2\n", {"convention": "kuka", "unit": "m"}),
    ],
)
def test_a_mapping_says_what_is_what(text: str, told: dict[str, str]) -> None:
    found = read(text, **told)
    np.testing.assert_allclose(found.poses[0].pose or (), (1000.5, 0, 500.1, 0, 1, 2), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "told", "match"),
    [
        (KUKA, {}, "table"),  # A B C are other angles on other controllers
        ("1,2,3,4,5,6\n", {}, "table"),
        (KUKA, {"columns": "x,y,z,A,B,C", "convention": "kuka"}, "6 for 7 columns"),
        (KUKA, {"columns": "name,x,y,z,A,B,B", "convention": "kuka"}, "columns 'b'"),
        (KUKA, {"columns": "name,x,y,z,A,B,color", "convention": "kuka"}, "'color'"),
        (KUKA, {"columns": "name,x,y,z,A,B,C"}, "convention"),
        (KUKA, {"convention": "motoman"}, "kawasaki"),
        ("x,y,z,qx,qy,qz,qw\n10,0,0,0,0,0,1\n", {}, "unit=mm"),
        ("", {"convention": "kuka"}, "empty"),
    ],
)
def test_what_is_not_said_is_asked_for(text: str, told: dict[str, str], match: str) -> None:
    with pytest.raises(InputError, match=match):
        read(text, **told)


def test_told_words_are_checked() -> None:
    with pytest.raises(InputError, match="'inch'"):
        Told.of({"unit": "inch"})
    with pytest.raises(InputError, match="'units'"):
        Told.of({"units": "mm"})


def test_an_unstated_unit_is_doubted_and_a_bad_row_named() -> None:
    found = read(
        "x,y,z,qx,qy,qz,qw\n1,0,0.5,0,0,0,1\n1,0,abc,0,0,0,1\n1,0,0.5,0,0,0\n1,0,0.5,0,0,0,2\n1,0,0.75,0,0,0,1"
    )
    assert [(pose.line, (pose.pose or ())[2]) for pose in found.poses] == [(2, 500), (6, 750)]
    assert "states no unit: m is taken" in found.poses[0].doubt
    assert "without an end of line" in found.poses[1].doubt
    assert {row.line: row.reason for row in found.skipped}.keys() == {3, 4, 5}


OPENCV = """%YAML:1.0
---
R_gripper2base_0: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0., 0., 1.5707963267948966 ]
t_gripper2base_0: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0.5, 0., 1.5 ]
base2gripper_1: !!opencv-matrix
   rows: 4
   cols: 4
   dt: d
   data: [ 1, 0, 0, -0.5, 0, 1, 0, 0, 0, 0, 1, -1.5, 0, 0, 0, 1 ]
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1, 0, 0, 0, 1, 0, 0, 0, 1 ]
"""


MATRICES = np.array([[[0, -1, 0, 900 + k], [1, 0, 0, 2 * k], [0, 0, 1, 300], [0, 0, 0, 1]] for k in range(3)])
BLOCKS = ["\n".join(" ".join(map(str, row)) for row in pose) for pose in MATRICES.tolist()]


@pytest.mark.parametrize(
    "text",
    [
        "\n\n".join(BLOCKS),
        "".join(f"p{k}\n[[{block}]]\n" for k, block in enumerate(BLOCKS)),
        "# flange\n"
        + "".join(f"p{k};" + block.replace("\n", " ").replace(" ", ";") + "\n" for k, block in enumerate(BLOCKS)),
        "".join(" ".join(block.replace("\n", " ").split()[:12]) + "\n" for block in BLOCKS),
    ],
)
def test_matrices_as_bare_numbers(text: str) -> None:
    found = read(text, "poses.txt")
    np.testing.assert_array_equal([np.reshape(p.pose, (4, 4)) for p in found.poses], MATRICES)
    assert {p.convention for p in found.poses} == {"matrix"}
    assert {p.name[0] for p in found.poses} <= {"p", "l"}
    with pytest.raises(InputError, match="what each column is"):
        read(text.replace("300", "0").replace("1", "2"), "poses.txt", brand="table")


def test_opencv() -> None:
    found = read(OPENCV, "a.yaml")
    assert [(pose.name, pose.line) for pose in found.poses] == [("R_gripper2base_0", 3), ("base2gripper_1", 13)]
    first, second = (parse_pose("matrix", pose.pose or ()) for pose in found.poses)
    np.testing.assert_allclose(first.matrix[:2, :2], [[0, -1], [1, 0]], atol=1e-12)
    np.testing.assert_allclose(first.translation_mm, [500, 0, 1500])
    np.testing.assert_allclose(second.translation_mm, [500, 0, 1500])
    assert "Turned round" in found.poses[1].doubt
    assert [row.line for row in found.skipped] == [18]
    cut = OPENCV[: OPENCV.index("1.5 ]")]
    with pytest.raises(InputError, match="OpenCV"):
        read(cut, "a.yaml")


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "a.csv"
    file.write_text(KUKA)
    assert main(["poses", str(file), "--set", "convention=kuka", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["brand"], told["poses"][0]["pose"]) == ("table", [1000.5, 0, 500.1, 0, 1, 2])
    assert main(["poses", str(file), "--set", "convention"]) == 2
    assert "NAME=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("name,x_mm,y_m,z_mm,A,B,C", "one unit for x, y and z"),
        ("name,x_m,y,z,A,B,C", "got m and none|got none and m"),
        ("name,x_deg,y_deg,z_deg,A,B,C", "one unit for x, y and z"),
        ("name,x_mm,y_mm,z_mm,A_rad,B_rad,C_rad", "angles in deg, as of 'kuka'"),
    ],
)
def test_a_header_whose_units_contradict_is_refused(head: str, words: str) -> None:
    file = {"a.csv": f"{head}\np1,1,2,3,4,5,6\n".encode()}
    with pytest.raises(InputError, match=words):
        read_controller_files(file, told=Told.of({"convention": "kuka"}))
