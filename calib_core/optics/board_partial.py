"""A chessboard seen in part: which of its corners are seen, and which ones these are, as far as that shows.

What tells is how many rows and columns there are, the sides where the squares end on the sheet's margin, and the
squares' colours.  Where several places on the board remain, the corners are given one of them: they lie right to
one another, which is all that a flat board's camera needs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.optics.board_corners import FittedCorners, fitted_at, refined, spacing
from calib_core.optics.board_refusal import CELL_BOARD, board_words, ends_in_frame
from calib_core.records import Board

Grey = NDArray[np.uint8]

FEWEST_CORNERS = 12
_NEARLY_ALL = 0.85
_SECOND = 0.6
_BORDER_PX = 3.0
_NEAR, _BEYOND, _MARGIN = 0.88, 1.12, 1.45  # pitches beyond the outer corners; the squares end at one
_LIKE, _UNLIKE = 0.3, 0.6  # of the contrast between the squares
_FEWEST_SQUARES = 3
_LEAST_CONTRAST = 0.7  # of the corner beside it, farther in


@dataclass(frozen=True, eq=False)
class PartOfBoard:
    """Where a chessboard's corners are seen.

    Attributes
    ----------
    grid : (rows, columns, 2)
        Of the whole board; NaN where a corner is not seen, px.
    is_numbered : bool
        Whether the corners are known to be those of their rows and columns.
    """

    grid: FloatArray
    is_numbered: bool

    def is_covered(self, grey: Grey) -> bool:
        """Whether all of the board would be in the frame: what is not seen of it is covered."""
        import cv2

        row, column = np.nonzero(np.isfinite(self.grid[..., 0]))
        seen = np.stack([column, row], axis=1).astype(float)
        onto_image, _ = cv2.findHomography(seen, self.grid[row, column])
        last_row, last_column = np.array(self.grid.shape[:2]) - 1.0
        edges = np.array([[[0.0, 0.0], [last_column, 0.0], [last_column, last_row], [0.0, last_row]]])
        return bool(_inside(grey, cv2.perspectiveTransform(edges, np.asarray(onto_image, dtype=float))[0]).all())


def whole_chessboard(grids: Sequence[FloatArray], board: Board) -> FloatArray | None:
    """Return a told board's corners (rows, columns, 2) where nearly all are seen at once, the others foretold."""
    if not grids or {*grids[0].shape[:2]} != {board.rows, board.columns}:
        return None
    grid = grids[0]
    grid = grid if grid.shape[0] == board.rows else grid.transpose(1, 0, 2)
    if np.isfinite(grid[..., 0]).mean() < _NEARLY_ALL:
        return None
    while (missing := np.isnan(grid[..., 0])).any():
        guesses = np.stack([np.rot90(_ahead(np.rot90(grid, turns)), -turns) for turns in range(4)])
        new = missing & np.isfinite(guesses[..., 0]).any(axis=0)
        if not new.any():
            return None
        grid = grid.copy()
        grid[new] = np.nanmean(guesses[:, new], axis=0)
    return grid


def refuse_second_board(grids: Sequence[FloatArray], board: Board) -> None:
    """Raise MeasurementError where a frame shows two boards as large as the told one, or nearly."""
    corners = [int(np.isfinite(grid[..., 0]).sum()) for grid in grids]
    if sum(count >= _SECOND * board.columns * board.rows for count in corners) > 1:
        raise MeasurementError("one board", "two boards in one frame", "Take or cover one of them.")


def seen_chessboard(grey: Grey, grids: Sequence[FloatArray], most: int) -> FloatArray | None:
    """Return the corners (rows, columns, 2) of the largest chessboard in a frame, NaN where one is not seen, px.

    None where there are fewer than a dozen, or fewer than three rows or columns; one that has clearly more than
    `most` corners a row is not looked at to its end.
    """
    if not grids:
        return None
    grid = _grown(grey, _clockwise(grids[0]), most)
    return grid if np.isfinite(grid[..., 0]).sum() >= FEWEST_CORNERS and min(grid.shape[:2]) >= 3 else None


def placed(grey: Grey, seen: FloatArray, board: Board) -> PartOfBoard | None:
    """Return a board of which a part is seen, None where that may be of another one.

    Parameters
    ----------
    grey : (H, W)
    seen : (rows, columns, 2)
        What `seen_chessboard` gave.
    board : Board

    Raises
    ------
    MeasurementError
        If the frame shows from edge to edge that the board has another number of corners.
    """
    ends = [_squares_end(grey, np.rot90(seen, turns)) for turns in range(4)]  # above, right, below, left
    counted = ends[0] and ends[2], ends[1] and ends[3]
    places = _places(grey, seen, ends, board)
    if not places:
        _refuse_another(seen, board, *counted)
        return None
    # What ends within the frame and shows no margin may be a smaller board as well as one that is covered.
    if ends_in_frame(seen, grey) and not any(counted) and seen[..., 0].size < board.rows * board.columns:
        return None
    if board.pitches_mm[0] != board.pitches_mm[1] and len({turns % 2 for turns, _, _ in places}) > 1:
        return None
    turns, row, column = places[0]
    turned = np.rot90(seen, turns)
    grid = np.full((board.rows, board.columns, 2), np.nan)
    grid[row : row + turned.shape[0], column : column + turned.shape[1]] = turned
    return PartOfBoard(grid, len(places) == 1)


def _clockwise(grid: FloatArray) -> FloatArray:
    """Return a grid whose y is clockwise of its x, as the image has them."""
    x, y = (np.nanmean(np.diff(grid, axis=axis), axis=(0, 1)) for axis in (1, 0))
    return grid if x[0] * y[1] - x[1] * y[0] > 0 else grid[::-1]


def _grown(grey: Grey, grid: FloatArray, most: int) -> FloatArray:
    """Return a grid with the corners around it that the frame shows as well, without those that it does not."""
    grid = np.where(_inside(grey, grid)[..., None], grid, np.nan)
    known = np.isfinite(grid[..., 0])
    grid[known] = refined(grey, grid[known], spacing(grid))
    fitted = _fitted(grey, grid, known)
    if fitted is None:  # the frame's edges are too sharp to judge further ones
        return _trimmed(grid)
    grid[known] = np.where(fitted.clean[:, None], fitted.points_px, np.nan)
    contrasts = np.full(known.shape, np.nan)
    contrasts[known] = fitted.contrasts
    grid, in_vain = _trimmed(_without_ends_of_squares(grid, contrasts)), 0
    while in_vain < 4 and min(grid.shape[:2]) >= 3 and max(grid.shape[:2]) <= most:
        grid, has_more = _grown_above(grey, grid)
        in_vain, grid = 0 if has_more else in_vain + 1, np.rot90(grid)
    return grid


def _grown_above(grey: Grey, grid: FloatArray) -> tuple[FloatArray, bool]:
    """Return a grid with the corners that follow three in a column above them, and whether there are any."""
    wider = np.pad(grid, ((1, 0), (0, 0), (0, 0)), constant_values=np.nan)
    ahead = _ahead(wider)
    new = np.isnan(wider[..., 0]) & _inside(grey, ahead)
    if not new.any():
        return grid, False
    beside = new.copy()
    for step in (1, 2, 3):
        beside[step:] |= new[:-step]
    tried = np.where(new[..., None], ahead, wider)
    fitted = _fitted(grey, tried, beside)
    if fitted is None:
        return grid, False
    found, contrasts = np.full(wider.shape, np.nan), np.full(wider.shape[:2], np.nan)
    found[beside] = np.where(fitted.clean[:, None], fitted.points_px, np.nan)
    contrasts[beside] = fitted.contrasts
    new &= np.isfinite(found[..., 0])
    new[:-1] &= contrasts[:-1] > _LEAST_CONTRAST * contrasts[1:]
    return (_trimmed(np.where(new[..., None], found, wider)), True) if new.any() else (grid, False)


def _without_ends_of_squares(grid: FloatArray, contrasts: FloatArray) -> FloatArray:
    """Return a grid without points on its sides where the outermost squares end on the margin.

    Only half of a corner's contrast is there; in noise that alone tells them from corners.
    """
    known = np.isfinite(grid[..., 0])
    for turns in range(4):
        seen, contrast = np.rot90(known, turns), np.rot90(contrasts, turns)
        above = np.pad(seen, ((1, 0), (0, 0)))[:-1]
        ends = seen[:-1] & ~above[:-1] & seen[1:] & (contrast[:-1] < _LEAST_CONTRAST * contrast[1:])
        known[np.rot90(np.pad(ends, ((0, 1), (0, 0))), -turns)] = False
    return np.where(known[..., None], grid, np.nan)


def _ahead(grid: FloatArray) -> FloatArray:
    """Return where each corner would be by the three below it, NaN where one of these is not known."""
    ahead = np.full(grid.shape, np.nan)
    ahead[:-3] = 3 * grid[1:-2] - 3 * grid[2:-1] + grid[3:]
    return ahead


def _fitted(grey: Grey, grid: FloatArray, which: NDArray[np.bool_]) -> FittedCorners | None:
    along_row, along_column = (_steps(grid, axis)[which] for axis in (1, 0))
    return fitted_at(grey, grid[which], along_row, along_column)


def _steps(grid: FloatArray, axis: int) -> FloatArray:
    """Return the step to the next corner along an axis, from those to both neighbours where they are known."""
    step = np.diff(grid, axis=axis)
    before, after = (np.insert(step, place, np.nan, axis=axis) for place in (0, step.shape[axis]))
    both = np.where(np.isnan(before), after, np.where(np.isnan(after), before, (before + after) / 2))
    usual = np.nanmedian(step.reshape(-1, 2), axis=0)
    return np.where(np.isnan(both), usual, both)


def _inside(grey: Grey, points: FloatArray) -> NDArray[np.bool_]:
    """Return which of points (…, 2) lie in the frame and not at its very edge."""
    height, width = grey.shape
    last = np.array([width - 1, height - 1]) - _BORDER_PX
    return np.asarray(((points >= _BORDER_PX) & (points <= last)).all(axis=-1))


def _trimmed(grid: FloatArray) -> FloatArray:
    """Return a grid without the rows and columns on its sides where nothing is known."""
    known = np.isfinite(grid[..., 0])
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    return grid[:0] if not len(rows) else grid[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def _squares_end(grey: Grey, grid: FloatArray) -> bool:
    """Return whether above its uppermost corners a grid has one more row of squares, and then an even margin."""
    first, second, third = grid[:3]
    # At each distance beyond the corners, in pitches, the middle of each square along them.
    step, bend = first - second, first - 2 * second + third
    rows: dict[float, FloatArray] = {}
    for distance in (-0.5, _NEAR, _BEYOND, _MARGIN):
        line = first + distance * step + distance * (distance + 1) / 2 * bend
        rows[distance] = _grey_between(grey, line)
    seen = np.all([np.isfinite(row) for row in rows.values()], axis=0)
    if seen.sum() < _FEWEST_SQUARES:
        return False
    contrasts = {distance: _contrast(row, seen) for distance, row in rows.items()}
    inner = contrasts[-0.5]
    if not np.isfinite(inner) or inner == 0:
        return False
    near, beyond, margin = (contrasts[distance] / inner for distance in (_NEAR, _BEYOND, _MARGIN))
    return near < -_UNLIKE and abs(beyond) < _LIKE and abs(margin) < _LIKE


def _grey_between(grey: Grey, line: FloatArray) -> FloatArray:
    """Return the grey value amid neighbours of a line of points (N, 2), (N − 1,); NaN outside the frame."""
    parts = np.array([0.3, 0.4, 0.5, 0.6, 0.7])[:, None, None]
    places = line[:-1] + parts * (line[1:] - line[:-1])
    inside: NDArray[np.bool_] = np.all(_inside(grey, places), axis=0)
    u, v = np.rint(np.where(inside[:, None], places, 0.0)).astype(int).transpose(2, 0, 1)
    return np.where(inside, grey[v, u].mean(axis=0), np.nan)


def _contrast(row: FloatArray, seen: NDArray[np.bool_]) -> float:
    """Return by how much every second square of a row is brighter than those between."""
    even = np.asarray(np.arange(len(row)) % 2 == 0)
    if not (seen & even).any() or not (seen & ~even).any():
        return float("nan")
    return float(np.median(row[seen & even]) - np.median(row[seen & ~even]))


def _places(grey: Grey, seen: FloatArray, ends: list[bool], board: Board) -> list[tuple[int, int, int]]:
    """Return where on the board a part may lie: turns by 90°, its first row and column."""
    looks_alike = (board.columns + board.rows) % 2 == 0  # turned by 180°: x is taken to point to the image's right
    rightward = [float(np.nanmean(np.diff(np.rot90(seen, turns), axis=1)[..., 0])) for turns in range(4)]
    found: list[tuple[int, int, int]] = []
    for turns in range(4):
        if looks_alike and rightward[turns] < (max(rightward) if board.columns == board.rows else 0):
            continue
        turned = np.rot90(seen, turns)
        above, right, below, left = (ends[(turns + side) % 4] for side in range(4))
        last_row, last_column = board.rows - turned.shape[0], board.columns - turned.shape[1]
        odd = 0 if looks_alike or _first_is_dark(grey, turned) else 1
        found += [
            (turns, row, column)
            for row, column in product(range(last_row + 1), range(last_column + 1))
            if not ((above and row > 0) or (below and row < last_row))
            and not ((left and column > 0) or (right and column < last_column))
            and (looks_alike or (row + column) % 2 == odd)
        ]
    return found


def _first_is_dark(grey: Grey, grid: FloatArray) -> bool:
    """Return whether a grid's first square is one of the dark ones."""
    middles = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
    row, column = np.nonzero(np.isfinite(middles[..., 0]))
    u, v = np.rint(middles[row, column]).astype(int).T
    values, even = grey[v, u].astype(float), np.asarray((row + column) % 2 == 0)
    return bool(np.mean(values[even]) < np.mean(values[~even]))


def _refuse_another(seen: FloatArray, board: Board, rows_counted: bool, columns_counted: bool) -> None:
    """Raise MeasurementError where a board's rows or columns are seen from edge to edge: they are not as told."""
    rows, columns = seen.shape[:2]
    to_do = message("Correct columns and rows in cell.board to the inner corners of the board, not its squares.")
    need = board_words(board.kind, board.columns, board.rows)
    if rows_counted and columns_counted:
        columns, rows = sorted((columns, rows), reverse=board.columns >= board.rows)
        got = message("a board of {columns} × {rows} inner corners from edge to edge", columns=columns, rows=rows)
        raise MeasurementError(need, got, to_do, CELL_BOARD)
    count = rows if rows_counted else columns
    if (rows_counted or columns_counted) and count not in (board.rows, board.columns):
        got = message("{count} inner corners from edge to edge", count=count)
        raise MeasurementError(need, got, to_do, CELL_BOARD)
