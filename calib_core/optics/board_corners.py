"""A chessboard's corners by a fit of their edges, where the frame's edges are what an optic makes of them.

Detectors of corners err by some hundredths of a pixel, alike over a whole board; the fit errs by the noise alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

LARGEST_RADIUS_PX = 8.0
SMALLEST_RADIUS_PX = 2.5
CLEARANCE_PX = 2.0  # from the next edge
_UNDERSAMPLED_PX = 0.45  # no optic and pixel blur less (a pixel alone 0.29): the frame was sharpened
_FARTHEST_PX = 1.5
_SPOILED_RATIO = 3.0
_LEAST_SHARE = 0.5
_LEAST_CONTRASTS = 12  # corners that tell how light falls off over a board
_ROUNDS = 5


@dataclass(frozen=True, eq=False)
class FittedCorners:
    """Corners of which the frame tells where they are.

    Attributes
    ----------
    points_px : (N, 2)
        All corners, row by row.
    clean : (N,)
        Whether a corner's surroundings look like one: no stripe, glare or dirt on it.
    contrasts : (N,)
        Between black and white about each, grey values.
    """

    points_px: FloatArray
    clean: NDArray[np.bool_]
    contrasts: FloatArray


def fitted_corners(grey: NDArray[np.uint8], grid: FloatArray) -> FittedCorners | None:
    """Return corners fitted to a frame's grey values, or None where the detector's own are better.

    That is so in frames whose edges are sharper than any optic's (sharpened by the camera, or badly undersampled).

    Parameters
    ----------
    grey : (H, W)
    grid : (rows, columns, 2)
        The detector's corners, px.
    """
    along_row, along_column = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    return fitted_at(grey, grid.reshape(-1, 2), along_row.reshape(-1, 2), along_column.reshape(-1, 2))


def fitted_at(
    grey: NDArray[np.uint8],
    points: FloatArray,
    along_row: FloatArray,
    along_column: FloatArray,
    largest_radius_px: float = LARGEST_RADIUS_PX,
) -> FittedCorners | None:
    """Return corners as `fitted_corners` does, for points (N, 2) with the steps (N, 2) to their neighbours, px."""
    from calib_core.kernels.corner import first_fits, fit_corners

    area = np.abs(along_row[:, 0] * along_column[:, 1] - along_row[:, 1] * along_column[:, 0])
    across = area / np.maximum(np.hypot(*along_row.T), np.hypot(*along_column.T))
    radii = np.clip(across - CLEARANCE_PX, SMALLEST_RADIUS_PX, largest_radius_px)
    normals = [np.arctan2(step[:, 0], -step[:, 1]) for step in (along_row, along_column)]
    first, found = np.empty((len(points), 10)), np.empty((len(points), 5))
    levels, starts = grey.astype(float), np.ascontiguousarray(points)
    first_fits(levels, starts, np.stack(normals, axis=1), radii, first)
    fit_corners(levels, starts, radii, first, _falls(points, first), found)
    settled = np.isfinite(found[:, 0]) & (np.hypot(*(found[:, :2] - points).T) < _FARTHEST_PX)
    if settled.mean() < _LEAST_SHARE:
        return None
    noise, blur = found[:, 3], found[:, 4]
    if float(np.median(blur[settled])) < _UNDERSAMPLED_PX:
        return None
    clean = settled & (noise < _SPOILED_RATIO * float(np.median(noise[settled])))
    return FittedCorners(np.where(clean[:, None], found[:, :2], points), clean, 2.0 * np.abs(first[:, 5]))


def _falls(points: FloatArray, fits: FloatArray) -> FloatArray:
    """Return how the contrast changes about each corner (N, 2), by share of itself a px, smooth over the board."""
    settled = np.isfinite(fits[:, 0])
    if settled.sum() < _LEAST_CONTRASTS:
        return np.zeros((len(points), 2))
    middle, scale = points[settled].mean(axis=0), max(float(np.ptp(points[settled], axis=0).max()) / 2, 1.0)
    x, y = ((points - middle) / scale).T
    one, none = np.ones(len(points)), np.zeros(len(points))
    basis = np.stack([one, x, y, x * x, x * y, y * y], axis=1)
    logs = np.log(np.maximum(np.abs(fits[settled, 5]), 1e-9))
    weights, terms = np.ones(len(logs)), np.zeros(basis.shape[1])
    for _ in range(_ROUNDS):
        terms = np.linalg.lstsq(basis[settled] * weights[:, None], logs * weights, rcond=None)[0]
        off = np.abs(logs - basis[settled] @ terms)
        weights = np.sqrt(np.minimum(1.0, 1.5 * float(np.median(off)) / np.maximum(off, 1e-9)))
    slopes = np.stack([none, one, none, 2 * x, y, none, none, none, one, none, x, 2 * y], axis=1).reshape(-1, 2, 6)
    return np.asarray(slopes @ terms / scale)


def refined(grey: NDArray[np.uint8], points: FloatArray, spacing_px: float) -> FloatArray:
    """Return corners (N, 2) refined by the grey values' gradients about them."""
    import cv2

    half = int(np.clip(0.35 * spacing_px, 2, 15))
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    start = points.reshape(-1, 1, 2).astype(np.float32)
    return np.asarray(cv2.cornerSubPix(grey, start, (half, half), (-1, -1), stop), dtype=float).reshape(-1, 2)


def spacing(grid: FloatArray) -> float:
    """Return the smallest distance between neighbours of a grid (rows, columns, 2), px."""
    return float(min(np.nanmin(np.linalg.norm(np.diff(grid, axis=a), axis=2)) for a in (0, 1)))
