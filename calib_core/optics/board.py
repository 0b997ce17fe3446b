"""The calibration board in a frame: its corners or circles, sub-pixel, or a sentence that says why not.

The board's frame has x along a row, y along a column, z into the board as the camera sees it; its origin is the
first corner (circle). A chessboard whose columns + rows is odd has one right way up, by its colours. Where the sum
is even it looks the same turned by 180°, and so do grids of circles: then x points to the image's right.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.optics.board_corners import FittedCorners, fitted_corners, refined, spacing
from calib_core.optics.board_lattice import lattices
from calib_core.optics.board_partial import (
    PartOfBoard,
    placed,
    refuse_second_board,
    seen_chessboard,
    whole_chessboard,
)
from calib_core.optics.board_refusal import (
    grey_eight_bit,
    grey_levels,
    is_blurred,
    refuse_flat_image,
    shrunk,
    why_not_found,
)
from calib_core.records import Board

IntArray = NDArray[np.int64]
Image = NDArray[Any]

_BLURRED_SHARE = 0.45  # of the distance between corners; beyond, the squares' edges run into each other


@dataclass(frozen=True, eq=False)
class BoardView:
    """A board as one frame shows it.

    Attributes
    ----------
    points_px : (N, 2)
        Corners or circle centres; (0, 0) is the centre of the top-left pixel.
    points_in_board_mm : (N, 3)
    ids : (N,)
        Row by row over the whole board; a chessboard or a ChArUco board may be seen in part.
    image_size : (width, height)
    corner_sigma_px : float
        Standard deviation of a coordinate, from how smoothly the points follow each other; NaN if too few.
    edge_width_px : float
        Rise of the squares' edges from 10 to 90 % (chessboards), else NaN.
    saturated : float
        Share of the board's area at the largest grey value.
    turn_is_ambiguous : bool
        Whether the board looks the same turned by 180°.
    in_colour : bool
        Whether the frame was turned into grey.
    left_out : int
        Corners under the stripe, glare or dirt, which are not among the points.
    unseen : int
        Corners of a chessboard outside the frame, or covered by more than that.
    is_numbered : bool
        Whether the corners are known to be those of their `ids`; else they lie right to one another alone.
    """

    points_px: FloatArray
    points_in_board_mm: FloatArray
    ids: IntArray
    image_size: tuple[int, int]
    corner_sigma_px: float
    edge_width_px: float = float("nan")
    saturated: float = 0.0
    turn_is_ambiguous: bool = False
    in_colour: bool = False
    left_out: int = 0
    unseen: int = 0
    is_numbered: bool = True


def find_board(image: Image, board: Board) -> BoardView:
    """Return the board in a frame.

    Parameters
    ----------
    image : (H, W) or (H, W, 3)
        uint8 or uint16; colour is turned into grey.
    board : Board

    Raises
    ------
    MeasurementError
        If the frame shows no board, another one, two of them, or is blank, blurred or saturated.
    InputError
        If the record lacks what this kind of board needs.
    """
    grey = grey_eight_bit(image)
    refuse_flat_image(grey)
    grids = lattices(grey) if board.kind == "chessboard" else None
    try:
        return _found(image, grey, board, grids)
    except MeasurementError as error:
        from calib_core.optics.board_other import refuse_other_kind

        refuse_other_kind(grey, board, error, grids)
        raise


def _found(image: Image, grey: NDArray[np.uint8], board: Board, grids: list[FloatArray] | None) -> BoardView:
    from calib_core.optics.board_charuco import find_charuco
    from calib_core.optics.board_circles import find_circles

    in_colour = image.ndim == 3
    if board.kind == "charuco":
        points, ids, in_board = find_charuco(grey, board)
        sigma = _grid_sigma(points, ids, board.columns - 1)
        return BoardView(points, in_board, ids, _size(grey), sigma, in_colour=in_colour)
    if grids is not None:
        return _chessboard(image, grey, board, grids)
    grid = find_circles(grey, board, points_in_board_mm(board))
    if grid is None:
        raise why_not_found(grey, board)
    grid = _oriented(grid, grey, board)
    points, ids = grid.reshape(-1, 2), np.arange(grid.size // 2)
    # The shift of every second row is no noise: compare even rows with even ones, odd with odd.
    smooth = np.concatenate([grid[0::2], grid[1::2]]).reshape(-1, 2)
    sigma = _grid_sigma(smooth if board.kind == "asymmetric-circles" else points, ids, board.columns)
    return BoardView(
        points, points_in_board_mm(board), ids, _size(grey), sigma,
        saturated=_saturated_share(image, points), turn_is_ambiguous=True, in_colour=in_colour,
    )  # fmt: skip


def _chessboard(image: Image, grey: NDArray[np.uint8], board: Board, grids: list[FloatArray]) -> BoardView:
    refuse_second_board(grids, board)
    lattice = whole_chessboard(grids, board)
    if lattice is not None:
        grid = _oriented(lattice, grey, board)
        if (fitted := fitted_corners(grey, grid)) is not None:
            return _of_whole(image, grey, board, fitted.points_px.reshape(grid.shape), fitted)
    seen = part = None
    if lattice is None and grids and _has_bright_areas(grey) and not is_blurred(grey):
        seen = seen_chessboard(grey, grids, max(board.columns, board.rows))
        part = None if seen is None else placed(grey, seen, board)
    if grids and (part is None or part.is_covered(grey)):
        searched = _searched_chessboard(grey, board)
        if searched is not None:
            grid = _oriented(searched, grey, board)
            return _of_whole(image, grey, board, grid, fitted_corners(grey, grid))
    if part is None:
        raise why_not_found(grey, board, seen)
    return _of_part(image, grey, board, part)


def _of_whole(
    image: Image, grey: NDArray[np.uint8], board: Board, grid: FloatArray, fitted: FittedCorners | None
) -> BoardView:
    """Return a chessboard by its corners, and by their fit where that is the better one."""
    points = grid.reshape(-1, 2)
    width = _edge_width(grey, board, points)
    _refuse_blurred(width, grid)
    ids = np.arange(len(points))
    if fitted is not None:
        ids, points = np.flatnonzero(fitted.clean), fitted.points_px[fitted.clean]
    return BoardView(
        points, points_in_board_mm(board)[ids], ids, _size(grey), _grid_sigma(points, ids, board.columns),
        width, _saturated_share(image, points), _looks_alike(board), image.ndim == 3, grid.size // 2 - len(ids),
    )  # fmt: skip


def _looks_alike(board: Board) -> bool:
    """Whether a chessboard looks the same turned by 180°."""
    return (board.columns + board.rows) % 2 == 0


def _of_part(image: Image, grey: NDArray[np.uint8], board: Board, part: PartOfBoard) -> BoardView:
    every = part.grid.reshape(-1, 2)
    ids = np.flatnonzero(np.isfinite(every[:, 0]))
    points = every[ids]
    return BoardView(
        points, points_in_board_mm(board)[ids], ids, _size(grey), _grid_sigma(points, ids, board.columns),
        float("nan"), _saturated_share(image, points), _looks_alike(board), image.ndim == 3,
        unseen=len(every) - len(ids), is_numbered=part.is_numbered,
    )  # fmt: skip


def points_in_board_mm(board: Board) -> FloatArray:
    """Return where a board's corners (circle centres) stand in its own frame, row by row, (N, 3), mm.

    The rows of an asymmetric grid are one pitch apart, the circles in a row two, every second row shifted by one.
    """
    columns, rows = (board.columns - 1, board.rows - 1) if board.kind == "charuco" else (board.columns, board.rows)
    row, column = np.mgrid[:rows, :columns]
    across = 2 * column + row % 2 if board.kind == "asymmetric-circles" else column
    return np.column_stack([across.ravel(), row.ravel(), np.zeros(row.size)]) * [*board.pitches_mm, 0.0]


def _searched_chessboard(grey: NDArray[np.uint8], board: Board) -> FloatArray | None:
    """Return the corners as OpenCV's detectors find them, or None.

    Large frames are searched at about a megapixel; their corners are then refined in the frame itself.
    """
    import cv2

    size = (board.columns, board.rows)
    small, factor = shrunk(grey)
    worth_it = _has_bright_areas(small)
    thorough = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE
    for flags in (0, thorough) if worth_it else (0,):
        found, corners = cv2.findChessboardCornersSB(small, size, flags=flags)
        if found:
            grid = np.asarray(corners, dtype=float).reshape(board.rows, board.columns, 2)
            return grid if factor == 1 else _refined(grey, (grid + 0.5) * factor - 0.5)
    if not worth_it:
        return None
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(
        grey, size, flags=flags if factor == 1 else flags | cv2.CALIB_CB_FAST_CHECK
    )
    if not found:
        return None
    return _refined(grey, np.asarray(corners, dtype=float).reshape(board.rows, board.columns, 2))


def _refined(grey: NDArray[np.uint8], grid: FloatArray) -> FloatArray:
    return refined(grey, grid, spacing(grid)).reshape(grid.shape)


def _has_bright_areas(grey: NDArray[np.uint8]) -> bool:
    """Whether a twentieth of the frame is clearly brighter than its ground, as a laser line in the dark is not."""
    ground, twentieth, bright = grey_levels(grey, [1, 95, 99.9])
    return twentieth - ground > 0.12 * (bright - ground)


def _oriented(grid: FloatArray, grey: NDArray[np.uint8], board: Board) -> FloatArray:
    """Return the grid with y clockwise of x, and turned the right way round where the board tells."""
    x, y = grid[:, -1].mean(0) - grid[:, 0].mean(0), grid[-1].mean(0) - grid[0].mean(0)
    if board.kind == "asymmetric-circles":
        return grid  # the shift of its rows has fixed both already
    if x[0] * y[1] - x[1] * y[0] < 0:
        grid, y = grid[::-1], -y
    if board.kind == "chessboard" and (board.columns + board.rows) % 2:
        first, last = _square_grey(grey, grid, 0, 0), _square_grey(grey, grid, -2, -2)
        return grid[::-1, ::-1] if first > last else grid
    return grid[::-1, ::-1] if x[0] < 0 else grid


def _square_grey(grey: NDArray[np.uint8], grid: FloatArray, row: int, column: int) -> float:
    """Return the mean grey in the middle of the square whose first corner is at a row and column."""
    quad = [grid[row, column], grid[row, column + 1], grid[row + 1, column + 1], grid[row + 1, column]]
    centre = np.mean(quad, axis=0)
    inner = np.array([centre + s * (corner - centre) for corner in quad for s in (0.0, 0.2, 0.4)])
    u, v = np.rint(inner).astype(int).T
    return float(grey[np.clip(v, 0, grey.shape[0] - 1), np.clip(u, 0, grey.shape[1] - 1)].mean())


def _edge_width(grey: NDArray[np.uint8], board: Board, points: FloatArray) -> float:
    import cv2

    if board.kind != "chessboard":
        return float("nan")
    corners = points.astype(np.float32).reshape(-1, 1, 2)
    mean, _ = cv2.estimateChessboardSharpness(grey, (board.columns, board.rows), corners)
    return float(np.ravel(mean)[0])


def _refuse_blurred(width_px: float, grid: FloatArray) -> None:
    apart_px = spacing(grid)
    if width_px > _BLURRED_SHARE * apart_px:
        raise MeasurementError(
            "sharp edges between the board's squares (narrower than {blurred_share:.0f} px)",
            "a blurred frame, edges {width_px:.0f} px wide",
            "Focus the lens, hold the board still, or expose less.",
            blurred_share=_BLURRED_SHARE * apart_px,
            width_px=width_px,
        )


def _grid_sigma(points: FloatArray, ids: IntArray, columns: int) -> float:
    """Return the standard deviation of a coordinate from third differences along rows.

    Perspective and distortion are smooth, so third differences are noise; their variance is 20 σ².
    """
    table = np.full((int(ids.max()) // columns + 1, columns, 2), np.nan)
    table[ids // columns, ids % columns] = points
    third = np.concatenate(
        [np.diff(table, 3, axis=a).reshape(-1, 2) for a in (0, 1) if table.shape[a] > 3] or [points[:0]]
    )
    third = third[np.isfinite(third).all(axis=1)]
    if len(third) < 6:
        return float("nan")
    return float(1.4826 * np.median(np.abs(third)) / np.sqrt(20))


def _saturated_share(image: Image, points: FloatArray) -> float:
    """Return the share of saturated pixels in the points' bounding box."""
    low = np.maximum(np.floor(points.min(0)).astype(int), 0)
    high = np.ceil(points.max(0)).astype(int) + 1
    part = image[low[1] : high[1], low[0] : high[0]]
    top = np.iinfo(image.dtype).max
    return float((part.reshape(part.shape[0], part.shape[1], -1).max(axis=2) >= top).mean())


def _size(grey: NDArray[np.uint8]) -> tuple[int, int]:
    return grey.shape[1], grey.shape[0]
