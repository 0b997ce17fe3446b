"""By how much light that falls off across a wide stripe draws its centres, and what of it is not known.

A ground that is brighter on one side draws a centre to it, by the square of the stripe's width; so does the
stripe's own light where the lens passes less of it towards the border.  How the ground's light falls off is read
from the board's light squares: lens and lamps together.  The laser's own light knows no lamps: there the law of
the cosine's fourth power stands, which lenses keep within a factor of two.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.optics.board import BoardView
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.stripe import StripeCenters

_INNER = 0.35  # of a square's side, to either side of its middle
_PERCENTILE = 75  # light paper also where a marker or circles lie on it
_DARK, _SATURATED = 5.0, 250.0
_CLEAR_WIDTHS = 4.0
_LEAST_SQUARES = 6
_GROUND_DOUBT = 0.3
_ROUNDS, _BISQUARE = 8, 4.685


@dataclass(frozen=True, eq=False)
class Drawn:
    """How far centres (N,) are drawn across the stripe, and what of it all boards may have alike in error."""

    px: FloatArray
    doubt_px: FloatArray


def light_squares(image: NDArray[np.uint8], board: BoardView) -> FloatArray:
    """Return column, row, grey value and half the side of a board's light squares, (M, 4).

    Those around the outermost corners are among them: they are the board's, too, or its sheet.
    """
    corners = board.points_in_board_mm[:, :2]
    low, levels = corners.min(axis=0), [np.unique(np.round(corners[:, k], 6)) for k in (0, 1)]
    if min(len(each) for each in levels) < 2:
        return np.zeros((0, 4))
    import cv2

    step = np.array([np.diff(each).min() for each in levels])
    pixels_from_board = cv2.findHomography((corners - low) / step, board.points_px)[0]
    squares: list[tuple[float, ...]] = []
    parity: list[int] = []
    counts = np.rint((corners.max(axis=0) - low) / step).astype(int)
    for i, j in np.ndindex(*(counts + 2)):
        middle_and_edges = np.array([[[i - 0.5, j - 0.5], [i, j - 0.5], [i - 0.5, j]]])
        middle, *edges = cv2.perspectiveTransform(middle_and_edges, pixels_from_board)[0]
        half = float(np.mean([np.hypot(*(edge - middle)) for edge in edges]))
        (left, top), reach = np.rint(middle - _INNER * 2 * half).astype(int), round(_INNER * 4 * half) + 1
        if left < 0 or top < 0 or left + reach > image.shape[1] or top + reach > image.shape[0]:
            continue
        patch = image[top : top + reach, left : left + reach]
        squares.append((*middle, float(np.percentile(patch, _PERCENTILE)), half))
        parity.append((i + j) % 2)
    found, odd = np.array(squares).reshape(-1, 4), np.array(parity, dtype=bool)
    if not odd.any() or odd.all():
        return found
    return found[odd == (np.median(found[odd, 2]) > np.median(found[~odd, 2]))]


def drawn_px(stripe: StripeCenters, squares: FloatArray, camera: CameraModel) -> Drawn:
    """Return how far a stripe's centres on a board are drawn; centres that no frame gave are not.

    Parameters
    ----------
    stripe : StripeCenters
        Those that form the line.
    squares : (M, 4)
        The board's light squares, see `light_squares`; those that the stripe crosses are left out.
    camera : CameraModel
    """
    lens = _lens_slope(camera, stripe.pixels)
    own = stripe.width_px**2 * (lens @ stripe.across)
    if stripe.ground is None or stripe.lever_px is None:
        return Drawn(np.zeros(len(own)), np.zeros(len(own)))
    lamps = _lamps_slope(stripe, squares, camera)
    told = lens if lamps is None else lens + lamps
    by_ground = stripe.ground * stripe.lever_px * (told @ stripe.across)
    return Drawn(own + by_ground, own + by_ground * (1.0 if lamps is None else _GROUND_DOUBT))


def _lens_light(camera: CameraModel, pixels: FloatArray) -> FloatArray:
    """Return the logarithm (N,) of how much light a lens passes: the cosine's fourth power."""
    matrix = camera.camera_matrix
    rays = (pixels - matrix[:2, 2]) / matrix[[0, 1], [0, 1]]
    return -2.0 * np.log1p((rays**2).sum(axis=1))


def _lens_slope(camera: CameraModel, pixels: FloatArray) -> FloatArray:
    """Return the slope (N, 2) of that logarithm, 1/px."""
    steps = np.eye(2)
    return np.stack(
        [(_lens_light(camera, pixels + step) - _lens_light(camera, pixels - step)) / 2 for step in steps], axis=1
    )


def _lamps_slope(stripe: StripeCenters, squares: FloatArray, camera: CameraModel) -> FloatArray | None:
    """Return how the squares' light rises over the board beside the lens's law, (2,), 1/px; None: not known."""
    middle = np.median(stripe.pixels, axis=0)
    direction = np.linalg.svd(stripe.pixels - middle, full_matrices=False)[2][0]
    away = np.abs((squares[:, :2] - middle) @ np.array([-direction[1], direction[0]]))
    fine = (away > _CLEAR_WIDTHS * stripe.width_px + np.sqrt(2) * squares[:, 3]) & (squares[:, 2] < _SATURATED)
    some = squares[fine & (squares[:, 2] > _DARK)]
    if len(some) < _LEAST_SQUARES:
        return None
    light = np.log(some[:, 2]) - _lens_light(camera, some[:, :2])
    basis = np.column_stack([np.ones(len(some)), some[:, :2] - middle])
    weight, found = np.ones(len(some)), np.zeros(3)
    for _ in range(_ROUNDS):  # glare and dirt are none of the lamps' light
        found = np.linalg.lstsq(basis * weight[:, None], light * weight, rcond=None)[0]
        off = np.abs(light - basis @ found)
        weight = np.clip(1 - (off / (_BISQUARE * 1.4826 * np.median(off) + 1e-9)) ** 2, 0, None)
    return np.asarray(found[1:], dtype=float)
