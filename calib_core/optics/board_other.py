"""Boards of another kind than was told: which one a frame shows in which the told one is not found."""

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import Message, message
from calib_core.optics.board_charuco import dictionary_in
from calib_core.optics.board_circles import seen_circles
from calib_core.optics.board_lattice import lattices
from calib_core.optics.board_partial import seen_chessboard
from calib_core.optics.board_refusal import CELL_BOARD, is_blurred, other_board, shrunk
from calib_core.records import Board

_LARGEST = 60
_PLAIN = 0.6  # of the contrast between squares: how bright the darkest of a white square may be


def refuse_other_kind(
    grey: NDArray[np.uint8], board: Board, error: MeasurementError, grids: list[FloatArray] | None = None
) -> None:
    """Raise MeasurementError where a frame in which the told board is not found shows another kind of board.

    Parameters
    ----------
    grey : (H, W)
    board : Board
        As it is told.
    error : MeasurementError
        Why it is not found.
    grids : list of (rows, columns, 2), optional
        What `lattices` gave of the frame, where it was looked for.
    """
    is_known = error.where == CELL_BOARD and board.kind == "charuco"
    if is_known or is_blurred(grey):
        return
    seen = _other_kind(grey, board, lattices(grey) if grids is None else grids)
    if seen is not None:
        raise other_board(board, seen) from None


def _other_kind(grey: NDArray[np.uint8], board: Board, grids: list[FloatArray]) -> Message | None:
    if grids and _is_plain(grey, grids[0]):
        grid = None if board.kind == "chessboard" else seen_chessboard(grey, grids, _LARGEST)
        if grid is None:
            return None
        return message(
            "a chessboard, {columns} × {rows} inner corners of it",
            columns=max(grid.shape[:2]),
            rows=min(grid.shape[:2]),
        )
    if board.kind != "charuco" and (dictionary := dictionary_in(grey)) is not None:
        return message("a ChArUco board, with markers of {dictionary}", dictionary=dictionary)
    if not board.kind.endswith("circles") and (circles := seen_circles(shrunk(grey)[0])) is not None:
        return circles.words
    return None


def _is_plain(grey: NDArray[np.uint8], grid: FloatArray) -> bool:
    """Return whether nothing stands in the white squares of a grid, as markers do."""
    across, down = np.meshgrid([0.25, 0.375, 0.5, 0.625, 0.75], [0.25, 0.375, 0.5, 0.625, 0.75])
    x, y = across.reshape(-1, 1, 1, 1), down.reshape(-1, 1, 1, 1)
    upper = (1 - x) * grid[:-1, :-1] + x * grid[:-1, 1:]
    places = (1 - y) * upper + y * ((1 - x) * grid[1:, :-1] + x * grid[1:, 1:])
    known = np.isfinite(places).all(axis=(0, 3))
    u, v = np.rint(places[:, known]).astype(int).transpose(2, 0, 1)
    values = grey[np.clip(v, 0, grey.shape[0] - 1), np.clip(u, 0, grey.shape[1] - 1)].astype(float)
    row, column = np.nonzero(known)
    even = (row + column) % 2 == 0
    if even.all() or not even.any():
        return False
    sides = [values[:, even], values[:, ~even]]
    dark, white = sorted(sides, key=lambda side: float(np.median(side.max(axis=0))))
    low, high = float(np.median(dark)), float(np.median(white.max(axis=0)))
    return float(np.median(white.min(axis=0))) > low + _PLAIN * (high - low)
