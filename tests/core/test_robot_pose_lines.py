"""Pasted pose lines: spreadsheets, logs and robot programs."""

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.robots import parse_pose_lines

SIX = [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]

FANUC_PRINT = """P[1]{
   GP1:
    UF : 0, UT : 1,        CONFIG : 'N U T, 0, 0, 0',
    X =  -195.800  mm,    Y =  1363.305  mm,    Z =   524.812  mm,
    W =  -179.924 deg,    P =      .889 deg,    R =   179.635 deg
};
"""


@pytest.mark.parametrize(
    "text",
    [
        "-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635",
        "-195.8;1363.305;524.812;-179.924;0.889;179.635",
        "-195.8\t1363.305\t524.812\t-179.924\t0.889\t179.635",
        "  -195.8 1363.305 524.812 -1.79924e2 .889 +179.635  ",
        "-195,8;1363,305;524,812;-179,924;0,889;179,635",
        "-195,8 1363,305 524,812 -179,924 0,889 179,635",
        "-195,8\t1363,305\t524,812\t-179,924\t0,889\t179,635",
        "p01: [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]",
        "p2024-05-01_10-00-30 -195.8 1363.305 524.812 -179.924 0.889 179.635",
        "scan-4;-195,8;1363,305;524,812;-179,924;0,889;179,635",
        "3) -195.8 1363.305 524.812 -179.924 0.889 179.635",
        "P[12] = (-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635), speed 20",
        "X -195,8 Y 1363,305 Z 524,812 W -179,924 P 0,889 R 179,635",
        "X = -195,8 mm, Y = 1363,305 mm, Z = 524,812 mm, W = -179,924°, P = 0,889°, R = 179,635°",
        "X=-195.8 mm Y=1363.305 mm Z=524.812 mm W=-179.924 deg P=0.889 deg R=179.635 deg",
        FANUC_PRINT,
    ],
)
def test_one_pose_however_it_is_written(text: str) -> None:
    (row,) = parse_pose_lines("fanuc", text)
    assert row.problem is None
    assert row.numbers == pytest.approx(SIX)
    assert row.pose is not None
    np.testing.assert_allclose(row.pose.translation_mm, SIX[:3])


@pytest.mark.parametrize(
    ("convention", "text", "numbers"),
    [
        (
            "abb",
            "CONST robtarget p10:=[[515.12,0.5,712],[0.707107,0,0.707107,0],[0,0,-1,0],"
            "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];",
            [515.12, 0.5, 712, 0.707107, 0, 0.707107, 0],
        ),
        (
            "kuka",
            "DECL E6POS XP1={X 280,Y 0,Z -10,A 30,B 90,C 0,S 2,T 35,E1 0,E2 0}",
            [280, 0, -10, 30, 90, 0],
        ),
        ("ur", "waypoint_1_p:=p[.117500, -.325000, .300000, 2.2, -2.2, .0]", [0.1175, -0.325, 0.3, 2.2, -2.2, 0]),
        ("nachi", "MOVEX A=1,M1X,P,(1960,0,1725,0,0,-180),R=5.0,H=1,MS,CONF=0000", [1960, 0, 1725, 0, 0, -180]),
        ("mitsubishi", "P1=(300.00,0.00,400.00,180.00,0.00,180.00)(7,0)", [300, 0, 400, 180, 0, 180]),
        ("kuka", "100,200,300,10,20,30", [100, 200, 300, 10, 20, 30]),
    ],
)
def test_lines_of_robot_programs(convention: str, text: str, numbers: list[float]) -> None:
    (row,) = parse_pose_lines(convention, text)
    assert row.problem is None
    assert row.numbers == pytest.approx(numbers)


def test_points_and_commas_at_once_are_a_problem_and_no_cut_numbers() -> None:
    (row,) = parse_pose_lines("kuka", "X 1.280,5 Y 0,5 Z -10,5 A 30,5 B 90,5 C 0,5")
    assert (row.pose, row.problem is not None) == (None, True)


def test_a_table_keeps_its_line_numbers_and_names_what_is_wrong() -> None:
    text = "x,y,z,w,p,r\n# taught on Monday\n\n1,2,3,4,5,6\n1,2,3,4,5\n1,2,3,nan,5,6\n7,8,9,10,11,12\n"
    rows = parse_pose_lines("fanuc", text)
    assert [r.line for r in rows] == [4, 5, 6, 7]
    assert [r.pose is not None for r in rows] == [True, False, False, True]
    assert "6 numbers (x y z W P R), got 5 numbers" in (rows[1].problem or "")
    assert "W = nan" in (rows[2].problem or "")
    assert rows[3].numbers == [7, 8, 9, 10, 11, 12]


def test_a_matrix_in_one_line_or_in_four() -> None:
    flat = "1 0 0 10  0 1 0 20  0 0 1 30  0 0 0 1"
    tall = "1 0 0 10\n0 1 0 20\n0 0 1 30\n0 0 0 1"
    rows = parse_pose_lines(
        "matrix", f"{flat}\n{tall}\n{flat}\n[[1, 0, 0, 40],\n [0, 1, 0, 20],\n [0, 0, 1, 30],\n [0, 0, 0, 1]]"
    )
    assert [r.line for r in rows] == [1, 2, 6, 7]
    xs = [r.pose.translation_mm[0] for r in rows if r.pose is not None]
    assert xs == [10, 10, 10, 40]


def test_two_blocks_in_braces_are_two_poses_and_an_open_one_is_a_problem_or_a_pose() -> None:
    rows = parse_pose_lines("fanuc", FANUC_PRINT + FANUC_PRINT.replace("-195.800", "-295.800"))
    assert [r.line for r in rows] == [1, 7]
    assert [r.numbers[0] for r in rows if r.numbers] == [-195.8, -295.8]
    (cut,) = parse_pose_lines("fanuc", FANUC_PRINT[:120])
    assert cut.pose is None
    assert "6 numbers" in (cut.problem or "")


def test_nothing_pasted_is_no_rows_and_an_unknown_convention_is_refused() -> None:
    assert parse_pose_lines("fanuc", "\n  \n# only a remark\n") == []
    with pytest.raises(InputError, match="kawasaki"):
        parse_pose_lines("abc", "1 2 3 4 5 6")
