"""A wrong convention told by the poses alone, before anything is measured."""

import numpy as np
import pytest

from calib_core.causes.likely import _spread_mm, likely_columns, likely_convention
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.records import Cell
from calib_core.robots import CONVENTIONS, parse_pose, to_pose
from calib_core.simulation import TcpScenario, simulate_tcp


def rows_of(convention: str, seed: int) -> list[list[float]]:
    """Return the poses of a simulated session, of which some hardly turn, in a convention."""
    session = simulate_tcp(seed, TcpScenario(orientations=3 + seed % 8)).session
    told = session.cell.pose_convention
    return [to_pose(convention, parse_pose(told, capture.pose)) for capture in session.captures if capture.pose]


@pytest.mark.parametrize("written", ["kuka", "fanuc", "staubli", "kawasaki", "abb", "quaternion-xyzw"])
def test_a_right_convention_stands_and_a_wrong_one_is_told(written: str) -> None:
    found, wrong = 0, 0
    for seed in range(1, 7):
        rows = rows_of(written, seed)
        for told in CONVENTIONS.values():
            if told.count != len(rows[0]):
                continue
            likely = likely_convention(Cell(pose_convention=told.name), rows)
            same = (told.form, told.listed) == (CONVENTIONS[written].form, CONVENTIONS[written].listed)
            if same:
                assert likely is None, (told.name, likely)
                continue
            wrong += 1
            if likely is not None:
                found += 1
                right = CONVENTIONS[likely.convention]
                assert (right.form, right.listed) == (CONVENTIONS[written].form, CONVENTIONS[written].listed)
                assert likely.spread_mm < 60
    assert found >= 0.85 * wrong


def test_metres_are_seen_through() -> None:
    rows = [[*np.array(row[:3]) / 1000, *row[3:]] for row in rows_of("fanuc", 3)]
    likely = likely_convention(Cell(pose_convention="kuka"), rows)
    assert likely is not None
    assert CONVENTIONS[likely.convention].form == CONVENTIONS["fanuc"].form


@pytest.mark.parametrize(
    "rows",
    [
        [],
        [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]] * 4,
        [[500.0, 0.0, 500.0, 180.0, 0.0, 0.0]] * 12,
        [[0.0] * 6] * 12,
        [[1e300, 2.0, 3.0, 4.0, 5.0, 6.0]] * 12,
        [[1.0, 2.0, 3.0]] * 12,
    ],
    ids=["none", "few", "equal", "zero", "huge", "short"],
)
def test_poses_that_tell_nothing(rows: list[list[float]]) -> None:
    assert likely_convention(Cell(pose_convention="kuka"), rows) is None
    assert likely_columns(Cell(pose_convention="kuka"), rows) is None


def test_swapped_columns_are_told_and_right_ones_stand() -> None:
    orders = [(1, 0, 2, 3, 4, 5), (0, 1, 2, 5, 4, 3), (3, 4, 5, 0, 1, 2)]
    told = 0
    for seed in range(1, 9):
        rows = np.array(rows_of("kuka", seed))
        assert likely_columns(Cell(pose_convention="kuka"), rows.tolist()) is None
        for order in orders:
            wrong = np.empty_like(rows)
            wrong[:, list(order)] = rows
            likely = likely_columns(Cell(pose_convention="kuka"), wrong.tolist())
            told += likely is not None
            assert likely is None or likely.order == order
    assert told >= 0.5 * 8 * len(orders)  # of the others the poses turn too little to tell


def test_how_far_a_flange_wanders_is_its_root_mean_square_and_nothing_where_it_turns_about_a_point() -> None:
    places = [[-5.0, 0.0, 0.0], [5.0, 0.0, 0.0]]
    level = [RigidTransform.of(np.eye(3), place, "base", "tool0") for place in places]
    assert _spread_mm(level) == pytest.approx(5.0)
    point_in_tool0, point_in_base = np.array([10.0, -20.0, 150.0]), np.array([800.0, 0.0, 300.0])
    turns = [rotation_from_vector(turn) for turn in ([0.1, 0, 0], [0, 0.3, 0], [0.2, -0.2, 0.4], [0, 0, 1.0])]
    about = [RigidTransform.of(turn, point_in_base - turn @ point_in_tool0, "base", "tool0") for turn in turns]
    assert _spread_mm(about) == pytest.approx(0.0, abs=1e-9)
