"""Why a frame does not show the board: each case in a sentence of its own."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import Message, message, templates
from calib_core.records import Board

Grey = NDArray[np.uint8]

_SHARP = 0.06
_SEARCHED_PIXELS = 1_400_000
# Of the frame; less counts where nothing else tells why no board is seen.
_MOSTLY_SATURATED, _SATURATED_IN_PART = 0.5, 0.1
_LEAST_CONTRAST = 12.0  # grey values of 255 between the dark and the bright of a frame
CELL_BOARD = "cell.board"
"""Where a frame contradicts what is told of the board: who looks at many frames says so first."""
BRING_WHOLE = message("Bring the whole board into the frame, without shadows, glare or fingers on it.")
MIRRORED = (
    message("the board as it is"),
    message("its mirror image"),
    message("Turn off mirroring in the camera's driver, or take the mirror out of the optics' path."),
    CELL_BOARD,
)
_BOARDS = templates(
    {
        "chessboard": "a chessboard of {columns} × {rows} inner corners",
        "charuco": "a ChArUco board of {columns} × {rows} squares",
        "circles": "a grid of {columns} × {rows} circles",
        "asymmetric-circles": "a grid of {columns} × {rows} circles, every second row shifted",
    }
)


def board_words(kind: str, columns: int, rows: int) -> Message:
    """Return what a board is called by its kind and size."""
    return message(_BOARDS[kind], columns=columns, rows=rows)


def other_board(board: Board, seen: Message) -> MeasurementError:
    """Return that a frame shows another board than the told one."""
    to_do = "Correct kind, columns and rows in cell.board."
    return MeasurementError(board_words(board.kind, board.columns, board.rows), seen, to_do, CELL_BOARD)


def grey_eight_bit(image: NDArray[Any]) -> Grey:
    """Return a frame as 8-bit grey.

    Raises
    ------
    InputError
        If it is not an image of 8 or 16 bit.
    """
    import cv2

    if image.dtype not in (np.dtype(np.uint8), np.dtype(np.uint16)) or image.ndim not in (2, 3) or image.size == 0:
        need = "a grey or colour image of 8 or 16 bit"
        to_do = "Save it as PNG or TIFF of 8 or 16 bit."
        raise InputError(need, "{dtype} of shape {frame}", to_do, dtype=image.dtype, frame=image.shape)
    if image.ndim == 3:
        image = cv2.cvtColor(np.ascontiguousarray(image[:, :, :3]), cv2.COLOR_RGB2GRAY)
    if image.dtype == np.uint16:  # 10, 12 or 14 of its bits may be used: the frame's own range says
        low, high = (float(v) for v in np.percentile(image, [0.1, 99.9]))
        image = np.clip((image.astype(np.float32) - low) * (255.0 / max(high - low, 255.0)), 0, 255)
    return np.ascontiguousarray(image, dtype=np.uint8)


def shrunk(grey: Grey) -> tuple[Grey, int]:
    """Return a frame of at most about a megapixel and by which whole factor it was shrunk."""
    import cv2

    factor = int(np.ceil(np.sqrt(grey.size / _SEARCHED_PIXELS)))
    if factor <= 1:
        return grey, 1
    height, width = (n // factor * factor for n in grey.shape)
    small = cv2.resize(grey[:height, :width], (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(small, dtype=np.uint8), factor


def grey_levels(grey: NDArray[np.uint8 | np.uint16], percents: Sequence[float]) -> list[float]:
    """Return percentiles of grey values, or of other whole numbers below 1024, at once."""
    import cv2

    counts = np.cumsum(cv2.calcHist([grey], [0], None, [1024], [0, 1024]))
    return [float(np.searchsorted(counts, percent / 100 * counts[-1])) for percent in percents]


def refuse_flat_image(grey: Grey) -> None:
    """Raise MeasurementError if nothing at all is to be seen."""
    dark, bright = grey_levels(grey, [0.5, 99.5])
    if bright - dark >= _LEAST_CONTRAST:
        return
    if dark >= 250:
        to_do = "Shorten the exposure or dim the laser or the lamps."
        raise MeasurementError("a frame that shows the board", "a saturated frame, white all over", to_do)
    got = (
        message("a black frame")
        if bright < 30
        else message("a blank frame, grey {dark:.0f} to {bright:.0f} of 255", dark=dark, bright=bright)
    )
    to_do = "Light the board, and check the exposure and lens cap."
    raise MeasurementError("a frame that shows the board", got, to_do)


def why_not_found(grey: Grey, board: Board, seen: FloatArray | None = None) -> MeasurementError:
    """Return the likeliest reason why the board was not found; `seen` is another chessboard, or a part of this."""
    need = message("the whole board, {board}", board=board_words(board.kind, board.columns, board.rows))
    saturated = float((grey >= 255).mean())
    if saturated > _MOSTLY_SATURATED:
        return _saturated(need, saturated)
    (bright,) = grey_levels(grey, [99.5])
    if bright < 60:
        got = "a frame too dark to find it (brightest grey {bright:.0f} of 255)"
        to_do = "Light the board, and check the exposure and lens cap."
        return MeasurementError(need, got, to_do, bright=bright)
    if is_blurred(grey):
        to_do = "Focus the lens, hold the board still, or expose less."
        return MeasurementError(need, "a blurred frame without a sharp edge", to_do)
    if seen is not None:
        rows, columns = seen.shape[:2]
        if columns * rows > board.columns * board.rows or (columns > board.columns and rows >= board.rows):
            to_do = message("Check columns and rows in cell.board: count inner corners, not squares.")
        elif ends_in_frame(seen, grey):
            to_do = message(
                "If nothing hides a part of the board, cell.board tells too many: count its inner corners, not "
                "squares."
            )
        else:
            to_do = BRING_WHOLE
        if {columns, rows} == {board.columns, board.rows}:
            count = int(np.isfinite(seen[..., 0]).sum())
            got = message("{count} of its corners, and nothing tells which way its rows run", count=count)
            return MeasurementError(need, got, BRING_WHOLE)
        return MeasurementError(
            need,
            "a board of {columns} × {rows} inner corners, or a part of one",
            to_do,
            columns=columns,
            rows=rows,
        )
    if saturated > _SATURATED_IN_PART:  # the board itself, or what outshines it
        return _saturated(need, saturated)
    to_do = "Bring the whole board into the frame, evenly lit, and check kind, columns and rows in cell.board."
    return MeasurementError(need, "no board", to_do)


def _saturated(need: Message, share: float) -> MeasurementError:
    to_do = "Shorten the exposure or dim the laser or the lamps."
    return MeasurementError(need, "a frame that is saturated over {saturated:.0%}", to_do, saturated=share)


def is_blurred(grey: Grey) -> bool:
    """Whether even the steepest slopes of a frame are small shares of its contrast per pixel."""
    dark, bright = grey_levels(grey, [0.5, 99.5])
    four = grey[: grey.shape[0] // 2 * 2, : grey.shape[1] // 2 * 2].astype(np.int16)
    four = four[::2] + four[1::2]
    slopes = np.abs(np.diff(four[:, ::2] + four[:, 1::2], axis=1)).astype(np.uint16)
    return grey_levels(slopes, [99.8])[0] / 8 < _SHARP * max(bright - dark, 1.0)


def ends_in_frame(grid: FloatArray, grey: Grey) -> bool:
    """Return whether a further row and column on every side would be in the frame, too."""
    last, height, width = np.array(grid.shape[:2]) - 1, *grey.shape
    for row, column in ((0, 0), (0, last[1]), (last[0], 0), (last[0], last[1])):
        inward = grid[min(max(row, 1), last[0] - 1), min(max(column, 1), last[1] - 1)]
        outside = 2 * grid[row, column] - inward
        if not (0 <= outside[0] < width and 0 <= outside[1] < height):
            return False
    return True
