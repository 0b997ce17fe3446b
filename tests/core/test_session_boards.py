"""A frame is searched for its board once, and what was found belongs to those bytes and that board."""

import cv2
import numpy as np
import pytest

from calib_core.captures import boards
from calib_core.captures.boards import Image, board_in, board_of
from calib_core.captures.measure import measure_capture
from calib_core.errors import MeasurementError
from calib_core.optics.board import BoardView, find_board
from calib_core.records import Board
from calib_core.simulation.frame_cell import FrameScenario, simulate_frames


@pytest.mark.thorough
def test_the_same_bytes_give_the_same_view_another_board_another_search(monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[Board] = []

    def searching(image: Image, board: Board) -> BoardView:
        searched.append(board)
        return find_board(image, board)

    monkeypatch.setattr(boards, "find_board", searching)
    session, files, _ = simulate_frames(FrameScenario("", camera_views=1), "one", 1)
    capture, read = session.captures[0], files.__getitem__
    board = board_of(session.cell)
    view = board_in(capture, board, read)
    again = board_in(capture, board, read)
    assert again.points_px.tobytes() == view.points_px.tobytes()
    assert again.left_out == view.left_out
    wider = board_in(capture, board.model_copy(update={"pitch_mm": 18.0}), read)
    assert wider.points_in_board_mm.max() == 2 * view.points_in_board_mm.max()
    other = Board(kind="chessboard", columns=7, rows=5, pitch_mm=9.0)
    for _ in range(2):  # a refusal is remembered too
        with pytest.raises(MeasurementError, match="9 × 6 inner corners from edge to edge"):
            board_in(capture, other, read)
    assert [b.columns for b in searched] == [board.columns, board.columns, 7]


@pytest.mark.thorough
def test_a_dark_board_with_the_stripe_says_that_it_does_not_count_any_more() -> None:
    session, _, _ = simulate_frames(FrameScenario("", camera_views=1), "one", 1)
    capture = session.captures[0].model_copy(update={"step": "laser-plane", "board_of": "c02"})
    seen = {}
    for name, grey in (("dark", 3), ("lit", 90)):
        frame = np.full((480, 640), grey, np.uint8)
        frame[240] = 255
        data = {capture.files[0]: cv2.imencode(".png", frame)[1].tobytes()}
        seen[name] = measure_capture(session, capture, data.__getitem__)
    assert {name: one.verdict for name, one in seen.items()} == {"dark": "fail", "lit": "fail"}
    assert "Dark boards do not count any more" in str(seen["dark"].to_do)
    assert "Dark boards" not in str(seen["lit"].to_do)
