"""What a ChArUco board's markers tell of it: how many squares it has, by the places that their numbers have."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.optics.board_refusal import CELL_BOARD
from calib_core.records import Board

IntArray = NDArray[np.int64]

_MOST_SQUARES = 40
_LEAST_MARKERS = 6  # fewer may fit several boards
_OFF_SIDES = 0.15  # of a marker's side: lens and bend leave less
_FITS, _MISFITS = 0.9, 0.7  # of the markers
_BELOW_EDGE = 0.1  # of a square: nearer than its marker
_LEAST_SQUARES = 3
_TRIES = 60  # of a homography: most markers are what they seem


def refuse_other_count(ids: IntArray, quads: FloatArray, board: Board, grey: NDArray[np.uint8]) -> None:
    """Raise MeasurementError where a ChArUco board's markers stand as those of a board of other squares.

    Parameters
    ----------
    ids : (N,)
        Numbers of the markers that are seen.
    quads : (N, 4, 2)
        Their corners, px.
    board : Board
        As it is told.
    grey : (H, W)
        The frame.
    """
    if len(ids) < _LEAST_MARKERS:
        return
    fit = {board.columns: _best_fit(ids, quads, board.columns)}
    if fit[board.columns].share < _MISFITS:
        fit = {columns: _best_fit(ids, quads, columns) for columns in range(2, _MOST_SQUARES + 1)}
    columns = max(fit, key=lambda c: (fit[c].share, c == board.columns))
    found = fit[columns]
    if found.share < _FITS:
        return
    seen = int(found.squares[found.on_board, 1].max()) + 1
    if columns == board.columns and seen <= board.rows and not _ends_at(found, seen, board, grey):
        return
    raise MeasurementError(
        "a ChArUco board of {told_columns} × {told_rows} squares, as cell.board says",
        "one of {columns} × {rows} squares, by its markers' numbers",
        "Correct columns and rows in cell.board: count squares, not corners.",
        CELL_BOARD,
        told_columns=board.columns,
        told_rows=board.rows,
        columns=columns,
        rows=seen,
    )


class _Fit:
    """How markers fit a board of so many columns.

    Attributes
    ----------
    squares : (N, 2)
        Column and row of the square in which each marker stands.
    onto_image : (3, 3) or None
        From squares to pixels.
    on_board : (N,)
        Which markers stand where they should.
    share : float
        Their share.
    """

    def __init__(self, squares: IntArray, quads: FloatArray) -> None:
        import cv2

        self.squares = squares
        self.on_board = np.zeros(len(squares), dtype=bool)
        centers = quads.mean(axis=1)
        side_px = float(np.median(np.hypot(*(quads[:, 1] - quads[:, 0]).T)))
        found: Any = None
        if all(len(np.unique(squares[:, k])) > 1 for k in (0, 1)):
            found, _ = cv2.findHomography(
                squares + 0.5, centers, cv2.RANSAC, _OFF_SIDES * side_px, maxIters=_TRIES
            )
        self.onto_image: FloatArray | None = None if found is None else np.asarray(found, dtype=float)
        if self.onto_image is not None:
            off = np.hypot(*(_mapped(self.onto_image, squares + 0.5) - centers).T)
            self.on_board = off < _OFF_SIDES * side_px
        self.share = float(self.on_board.mean())


def _best_fit(ids: IntArray, quads: FloatArray, columns: int) -> _Fit:
    """Return how markers fit a board that begins with a black square, or with a white one."""
    fits = [_Fit(_squares(ids, columns, first), quads) for first in (1, 0)]
    return max(fits, key=lambda fit: fit.share)


def _squares(ids: IntArray, columns: int, first: int) -> IntArray:
    """Return column and row (N, 2) of markers, which number the white squares row by row.

    Parameters
    ----------
    first : {0, 1}
        The column of the first marker.
    """
    rows = int(ids.max()) // max(columns // 2, 1) + 2
    row, column = np.mgrid[:rows, :columns]
    white = (row + column) % 2 == first
    places = np.column_stack([column[white], row[white]])
    return places[ids]


def _ends_at(fit: _Fit, row: int, board: Board, grey: NDArray[np.uint8]) -> bool:
    """Whether the board is seen to end above a row that is told: where its black squares should begin, none does.

    A hand or a shadow hides squares too, but hardly all from their very edge on, and no marker above.
    """
    if fit.onto_image is None or row >= board.rows:
        return False
    first = int(fit.squares[0].sum() % 2)
    columns = np.arange(board.columns)
    dark = [_grey_of(fit.onto_image, columns[(columns + r) % 2 != first], r, grey) for r in (row - 1, row)]
    if min(len(each) for each in dark) < _LEAST_SQUARES:
        return False
    squares = fit.squares[fit.on_board]
    white = _grey_of(fit.onto_image, squares[squares[:, 1] == row - 1, 0], row - 1, grey)
    if len(white) < len(_grey_of(fit.onto_image, columns[(columns + row - 1) % 2 == first], row - 1, grey)):
        return False
    middle = (np.median(dark[0]) + np.median(white)) / 2
    return bool(np.median(dark[0]) < middle and np.mean(dark[1] > middle) > _FITS)


def _grey_of(onto_image: FloatArray, columns: IntArray, row: int, grey: NDArray[np.uint8]) -> FloatArray:
    """Return the grey values close below the upper edge of a row's squares, of those in the frame."""
    at = _mapped(onto_image, np.column_stack([columns + 0.5, np.full(len(columns), row + _BELOW_EDGE)]))
    u, v = np.rint(at).astype(int).T
    inside = (u >= 0) & (u < grey.shape[1]) & (v >= 0) & (v < grey.shape[0])
    return grey[v[inside], u[inside]].astype(float)


def _mapped(homography: FloatArray, places: NDArray[Any]) -> FloatArray:
    homogeneous = np.column_stack([places, np.ones(len(places))]) @ homography.T
    return homogeneous[:, :2] / homogeneous[:, 2:]
