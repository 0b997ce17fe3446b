"""A camera from boards that hang out of the image, and what is told of them."""

import numpy as np
import pytest

from calib_core.findings.codes import quality
from calib_core.optics.board import BoardView, find_board
from calib_core.optics.board_partial import PartOfBoard
from calib_core.optics.camera import calibrate_camera
from calib_core.records import Board
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, light, sense
from calib_core.simulation.motion import pose, turn
from tests.boards_in_part import CAMERA, PITCH_MM, SHAPE, cut_off_views

BOARD = Board(kind="chessboard", columns=SHAPE[0], rows=SHAPE[1], pitch_mm=PITCH_MM)


def found_views(seed: int) -> tuple[list[BoardView], list[int]]:
    frames, inside = cut_off_views(seed)
    return [find_board(frame, BOARD) for frame in frames], [len(each) for each in inside]


@pytest.mark.thorough
def test_a_camera_from_boards_cut_off_by_a_third() -> None:
    views, inside = found_views(0)
    assert all(len(view.ids) >= 0.9 * count for view, count in zip(views, inside, strict=True))
    assert sum(view.is_numbered for view in views) >= 8
    found = calibrate_camera(views, (CAMERA.width, CAMERA.height))
    assert not found.rejected
    off = found.camera.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - [*CAMERA.focal_px, *CAMERA.center_px]
    places = [found.parameters.index(name) for name in ("fx", "fy", "cx", "cy")]
    # Four degrees of freedom: beyond 18.5 once in a thousand.
    assert off @ np.linalg.solve(found.covariance[np.ix_(places, places)], off) < 18.5
    assert np.sqrt(found.covariance[places[0], places[0]]) < 2.0


def test_a_part_of_a_board_on_a_tenth_of_a_dark_frame_is_taken() -> None:
    (frame,), (inside,) = cut_off_views(8, 1)
    view = find_board(frame, BOARD)
    assert len(view.ids) >= 0.9 * len(inside)
    assert view.is_numbered


def test_what_is_told_of_a_board_in_part() -> None:
    told = quality.BOARD_IN_PART(["b01"], seen=36, count=54, place="open")
    assert "36 of 54 corners are seen" in str(told.text)
    assert told.severity == "note"


@pytest.mark.parametrize(("width", "covered"), [(210, True), (195, False)])
def test_a_board_is_covered_where_all_of_it_would_be_in_the_frame(width: int, covered: bool) -> None:
    rows, columns = np.mgrid[0:6, 0:9].astype(float)
    grid = np.stack([40 + 20 * columns, 40 + 20 * rows], axis=-1)  # its last corner is at column 200
    grid[2:, 6:] = np.nan
    assert PartOfBoard(grid, is_numbered=True).is_covered(np.zeros((200, width), dtype=np.uint8)) == covered


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_ends_of_squares_in_a_dim_noisy_frame_are_no_corners(seed: int) -> None:
    """They were, and the board was then said to have other corners than those told."""
    rng = np.random.default_rng([seed])
    rotation = turn(rng.uniform(-1, 1, 3) * [0.4, 0.4, 0.5])
    board = BoardSurface(pose(rotation, np.array([0, 0, 260.0]) - rotation @ [36.0, 22.5, 0]), pitch_mm=9.0)
    dim = Exposure(ambient=60.0, read_noise=4.0, blur_per_mm=0.0)
    camera = SimulatedCamera()
    room = light(camera, [board], None, dim, rng) * np.linspace(1.0, 0.3, camera.width)
    view = find_board(sense(room, dim, rng), Board(kind="chessboard", columns=9, rows=6, pitch_mm=9.0))
    assert len(view.ids) == 54
    assert view.is_numbered
