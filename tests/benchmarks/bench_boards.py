"""Boards in a frame: chessboards cut off by a third, how fast one is found, and boards described wrongly."""

import re
import time
from contextlib import suppress

import cv2
import numpy as np
from harness import Row

from calib_core.errors import MeasurementError
from calib_core.optics.board import find_board
from calib_core.optics.camera import calibrate_camera
from calib_core.records import Board
from tests.boards_in_part import CAMERA, PITCH_MM, SHAPE, cut_off_views
from tests.wrong_boards import RIGHT, board_frames, wrong_descriptions

_BOARD = Board(kind="chessboard", columns=SHAPE[0], rows=SHAPE[1], pitch_mm=PITCH_MM)
_LENS = ("fx", "fy", "cx", "cy")


def run(full: bool) -> list[Row]:
    """Return the rows; `full` takes twenty sets of twelve boards, otherwise four."""
    sets = 20 if full else 4
    used, frames_of_all, ratios = 0, 0, []
    for seed in range(sets):
        frames, _ = cut_off_views(seed)
        views = []
        for frame in frames:
            try:
                views.append(find_board(frame, _BOARD))
            except MeasurementError:
                continue
        frames_of_all, used = frames_of_all + len(frames), used + len(views)
        found = calibrate_camera(views, (CAMERA.width, CAMERA.height))
        off = found.camera.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - [*CAMERA.focal_px, *CAMERA.center_px]
        places = [found.parameters.index(name) for name in _LENS]
        ratios.append(float(off @ np.linalg.solve(found.covariance[np.ix_(places, places)], off)) / len(_LENS))
    rms = float(np.sqrt(np.mean(ratios)))
    whole, empty = _seconds()
    of = f"boards cut off by a third, {sets} sets of 12"
    return [
        Row(f"{of}: used", "all", f"{used} of {frames_of_all}", used == frames_of_all),
        Row(f"{of}: camera's error / stated", "0.7–1.3", f"{rms:.2f}", 0.7 <= rms <= 1.3),
        Row(
            "a board in a frame of 1920×1080, of the processor", "≤ 40 ms", f"{1e3 * whole:.0f} ms", whole <= 0.04
        ),
        Row("the same without a board", "≤ 80 ms", f"{1e3 * empty:.0f} ms", empty <= 0.08),
        *_described_wrongly(20 if full else 4),
    ]


def _described_wrongly(frames: int) -> list[Row]:
    """Return how often a wrong description is named, and a right board accused, in frames of each kind."""
    named, wrong, accused, right = 0, 0, 0, 0
    for kind, board in RIGHT.items():
        seen = board_frames(board, 43, frames)
        right, accused = right + len(seen), accused + sum(_reason(frame, board) is not None for frame in seen)
        for one in wrong_descriptions(kind):
            reasons = [_reason(frame, one.told) for frame in seen]
            wrong += len(reasons)
            named += sum(r is not None and re.search(one.says, r) is not None for r in reasons)
    of = f"4 kinds of board × 12 wrong descriptions × {frames} frames"
    return [
        Row(f"{of}: named", "≥ 95 %", f"{named} of {wrong}", named >= 0.95 * wrong),
        Row("boards described rightly that are refused", "0", f"{accused} of {right}", accused == 0),
    ]


def _reason(frame: np.ndarray, board: Board) -> str | None:
    """Return what a frame shows instead of a board, None where it shows it."""
    try:
        find_board(frame, board)
    except MeasurementError as error:
        return str(error.got)
    return None


def _seconds() -> tuple[float, float]:
    """Return the least time of the processor for a frame with a board, and for one of soft spots without."""
    frame, _ = cut_off_views(0, 1)
    large = cv2.resize(frame[0], (1920, 1080), interpolation=cv2.INTER_CUBIC)
    whole = np.full_like(large, 200)
    for row in range(7):
        for column in range(10):
            if (row + column) % 2 == 0:
                cv2.rectangle(
                    whole, (300 + 110 * column, 150 + 110 * row), (409 + 110 * column, 259 + 110 * row), 40, -1
                )
    whole = cv2.GaussianBlur(whole, (0, 0), 1.0)
    spots = cv2.GaussianBlur(np.random.default_rng(3).normal(0, 1, large.shape), (0, 0), 6.0)
    empty = np.clip(128 + 60 * spots / spots.std(), 0, 255).astype(np.uint8)
    return _least(whole), _least(empty)


def _least(image: np.ndarray) -> float:
    took = []
    for _ in range(8):
        begin = time.process_time()
        with suppress(MeasurementError):
            find_board(image, _BOARD)
        took.append(time.process_time() - begin)
    return min(took)
