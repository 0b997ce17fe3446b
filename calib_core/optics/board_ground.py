"""A frame without its board: what each square's even light is taken off, so that the laser's alone stands out.

Faint lines are far darker than the pattern that they cross.  Where the board is, is known to a fraction of a
pixel: inside a square its light is a plane, and what stands above it is no pattern.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView

SCALE, LEVEL = 16.0, 16_000.0
"""Steps of a grey value in what is left, and what stands for none."""

EDGE_PX = 2.5
"""Beside a square's edge the blur is not yet even: that is left out."""

SATURATED = 65_535.0
"""What a saturated pixel is in it."""

_LEAST_SIDE_PX = 9.0
_BEYOND = 3  # squares beyond the outermost corners: the sheet goes on
_ROUNDS, _MOST_ABOVE, _MOST_SAMPLES = 5, 2.5, 250
_UNEVEN = 3.0  # times as rough as squares are: markers, dots, the sheet's end
_LEAST_SQUARES = 4
_HOT = 6.0


def without_board(
    image: NDArray[np.uint8 | np.uint16], board: BoardView, pixels: Callable[[FloatArray], FloatArray]
) -> NDArray[np.uint16] | None:
    """Return what is left of a frame (H, W) where its squares' light is taken off; None where hardly any is even.

    Where no square is even, nothing is known: noise stands there, as strong as that in the squares, so that what a
    frame says of its noise stays true.

    Parameters
    ----------
    image : (H, W)
    board : BoardView
    pixels : callable
        From places (N, 2) on the board, mm, to pixels.
    """
    corners = board.points_in_board_mm[:, :2]
    low, levels = corners.min(axis=0), [np.unique(np.round(corners[:, k], 6)) for k in (0, 1)]
    if min(len(each) for each in levels) < 2:
        return None
    pitch = np.array([np.diff(each).min() for each in levels])
    count = np.rint((corners.max(axis=0) - low) / pitch).astype(int)
    found: list[_Square] = []
    for cell in np.ndindex(*(count + 2 * _BEYOND)):
        place = np.array(cell) - _BEYOND
        inside = _inside(pixels(low + (place + _UNIT) * pitch), image.shape)
        if inside is not None:
            beyond = bool(np.any(place < -1) or np.any(place > count))
            found.append(_Square(inside, beyond, *_left(image, inside)))
    squares = [one for one in found if not one.beyond]
    if len(squares) < _LEAST_SQUARES:
        return None
    usual = float(np.median([one.rough for one in squares]))
    paper = float(np.percentile([one.level for one in squares], 75))
    result = np.random.default_rng(0).normal(0.0, usual, image.shape)
    for one in found:
        if one.rough <= _UNEVEN * usual and (one.level > paper / 2 or not one.beyond):
            result[one.inside[0], one.inside[1]] = one.left
    beside = np.max([np.roll(result, step, axis) for axis in (0, 1) for step in (-1, 1)], axis=0)
    result[result > beside + _HOT * usual] = 0.0
    result = np.clip(np.rint(SCALE * result + LEVEL), 0, SATURATED - 1)
    full = 255 if image.dtype == np.uint8 else max(int(image.max()), 1023)
    result[(image >= full) & (result != LEVEL)] = SATURATED
    return result.astype(np.uint16)


class _Square(NamedTuple):
    """A square's pixels, rows and columns (2, N), whether it is of the sheet beyond, and what was found there."""

    inside: NDArray[np.int64]
    beyond: bool
    left: FloatArray
    rough: float
    level: float


_UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def _inside(outline: FloatArray, shape: tuple[int, ...]) -> NDArray[np.int64] | None:
    """Return rows and columns (2, N) of pixels well within a square; None: it is small or not in the frame."""
    import cv2

    if not np.isfinite(outline).all():
        return None
    sides = np.hypot(*(outline - np.roll(outline, 1, axis=0)).T)
    if sides.min() < _LEAST_SIDE_PX:
        return None
    middle = outline.mean(axis=0)
    outline = middle + (outline - middle) * (1 - 2 * EDGE_PX / sides.min())
    first, last = np.floor(outline.min(axis=0)).astype(int), np.ceil(outline.max(axis=0)).astype(int)
    if first.min() < 0 or last[0] >= shape[1] or last[1] >= shape[0]:
        return None
    mask = np.zeros((last - first + 1)[::-1], np.uint8)
    cv2.fillConvexPoly(mask, np.rint(16 * (outline - first)).astype(np.int32), 1, shift=4)
    rows, columns = np.nonzero(mask)
    return np.stack([rows + first[1], columns + first[0]])


def _left(image: NDArray[np.uint8 | np.uint16], inside: NDArray[np.int64]) -> tuple[FloatArray, float, float]:
    """Return what stands above a square's plane of light, (N,), how rough the square is, and how bright."""
    light = image[inside[0], inside[1]].astype(float)
    at = (inside - inside.mean(axis=1, keepdims=True)) / max(float(np.ptp(inside, axis=1).max()), 1.0)
    basis = np.column_stack([np.ones(light.size), at.T])
    some = slice(None, None, max(1, light.size // _MOST_SAMPLES))
    plane, rough = np.array([np.median(light), 0.0, 0.0]), np.inf
    for _ in range(_ROUNDS):  # what stands above is the laser's: noise is what lies below
        off = light[some] - basis[some] @ plane
        below = off[off <= 0]
        rough = max(float(np.sqrt(np.mean(below**2))) if below.size else 0.0, 0.3)
        kept = off <= _MOST_ABOVE * rough
        plane = np.linalg.lstsq(basis[some][kept], light[some][kept], rcond=None)[0]
    return light - basis @ plane, rough, float(plane[0])
