"""Boards that are described wrongly are named, whatever their kind; right ones never."""

import re
from functools import cache

import cv2
import numpy as np
import pytest

from calib_core.captures.boards import board_first, frames_not_used, likeliest_failure
from calib_core.errors import MeasurementError
from calib_core.findings import has, judgement
from calib_core.findings.codes import camera as codes
from calib_core.optics.board import find_board
from calib_core.optics.board_refusal import CELL_BOARD
from calib_core.records import Board
from calib_core.simulation.frames import ImageArray
from tests.wrong_boards import RIGHT, Wrong, board_frames, wrong_descriptions

CASES = [
    pytest.param(kind, wrong, id=f"{kind}, {wrong.name}") for kind in RIGHT for wrong in wrong_descriptions(kind)
]


@cache
def frame_of(kind: str) -> ImageArray:
    """Return what a camera sees of a board, rendered only where a test asks."""
    return board_frames(RIGHT[kind], 7, 1)[0]


@pytest.mark.thorough(keep=3)
@pytest.mark.parametrize(("kind", "wrong"), CASES)
def test_a_wrong_description_is_named_with_what_to_correct(kind: str, wrong: Wrong) -> None:
    with pytest.raises(MeasurementError) as caught:
        find_board(frame_of(kind), wrong.told)
    assert re.search(wrong.says, str(caught.value.got))
    assert caught.value.where == "cell.board"
    assert "cell.board" in str(caught.value.to_do)


@pytest.mark.parametrize("kind", RIGHT)
def test_a_right_description_finds_the_board_turned_by_any_quarter(kind: str) -> None:
    for turns in range(4):
        view = find_board(np.ascontiguousarray(np.rot90(frame_of(kind), turns)), RIGHT[kind])
        _assert_seen_from_the_front(view.points_in_board_mm, view.points_px)


@pytest.mark.parametrize("rows", [10, 11])
def test_asymmetric_circles_are_numbered_from_the_front_whichever_way_they_are_turned(rows: int) -> None:
    board = Board(kind="asymmetric-circles", columns=4, rows=rows, pitch_mm=8.0)
    frame = board_frames(board, 3, 1)[0]
    for turns in range(4):
        view = find_board(np.ascontiguousarray(np.rot90(frame, turns)), board)
        _assert_seen_from_the_front(view.points_in_board_mm, view.points_px)
    if rows == 10:  # with an odd number of rows the mirror image is the board turned by 180°
        with pytest.raises(MeasurementError, match="its mirror image"):
            find_board(np.ascontiguousarray(frame[:, ::-1]), board)


def _assert_seen_from_the_front(places_mm: np.ndarray, pixels: np.ndarray) -> None:
    onto_image, _ = cv2.findHomography(places_mm[:, :2], pixels)
    again = cv2.perspectiveTransform(places_mm[None, :, :2].astype(float), onto_image)[0]
    assert np.linalg.det(onto_image) > 0
    assert np.abs(again - pixels).max() < 1.0  # the lens bends it by as much


def test_circles_of_which_some_are_outside_are_part_of_the_told_grid() -> None:
    frame = frame_of("circles").copy()
    view = find_board(frame, RIGHT["circles"])
    shift = int(view.points_px[:, 0].max()) - frame.shape[1] + 30
    moved = np.ascontiguousarray(
        np.roll(frame, -shift if shift > 0 else 0, axis=1)[:, : int(view.points_px[:, 0].max()) - 20]
    )
    with pytest.raises(MeasurementError) as caught:
        find_board(moved, RIGHT["circles"])
    assert caught.value.where == ""
    assert "Bring the whole board into the frame" in str(caught.value.to_do)


def test_what_frames_contradict_is_said_before_why_single_ones_are_not_used() -> None:
    told = RIGHT["chessboard"].model_copy(update={"columns": 10})
    failed: dict[str, MeasurementError] = {"c1": MeasurementError("a frame", "a blurred frame", "Focus the lens.")}
    for k, frame in enumerate(board_frames(RIGHT["chessboard"], 11, 2)):
        with pytest.raises(MeasurementError) as caught:
            find_board(frame, told)
        failed[f"c{k + 2}"] = caught.value
    findings = frames_not_used(failed, used=4)
    assert [one.code for one in findings] == ["board-not-as-told", "frame-not-used"]
    assert findings[0].captures == ["c2", "c3"]
    name, error = likeliest_failure(failed)
    assert name == "c2"
    assert "9 × 6" in str(error.got)
    assert not has(frames_not_used(failed, used=12), codes.BOARD_NOT_AS_TOLD)


def test_a_board_that_is_not_as_told_stands_first_and_few_views_behind_it() -> None:
    wrong = MeasurementError("the board", "one of 9 × 6", "Correct cell.board.", CELL_BOARD)
    told = [
        codes.FEW_VIEWS(count=2),
        codes.BOARDS_NOT_TILTED(tilt_deg=9.0),
        *frames_not_used({"c1": wrong}, used=2),
    ]
    found = judgement(board_first(told))
    assert [one.code for one in found["findings"]][:1] == ["board-not-as-told"]
    assert len(found["warnings"]) == 2  # few views follow from it
