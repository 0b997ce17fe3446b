"""Grids of circles, symmetric and asymmetric, dark on bright and bright on dark."""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.records import Board


def find_circles(grey: NDArray[np.uint8], board: Board) -> FloatArray | None:
    """Return the circles' centres as (rows, columns, 2), px, or None where the grid is not seen.

    Each centre is the centroid of the circle's darkness (brightness). Under perspective that is off the projected
    centre by about the square of the circle's size over the distance: small circles are better.
    """
    import cv2

    layout = cv2.CALIB_CB_ASYMMETRIC_GRID if board.kind == "asymmetric-circles" else cv2.CALIB_CB_SYMMETRIC_GRID
    for image in (grey, 255 - grey):  # OpenCV looks for dark blobs
        for flags in (layout, layout | cv2.CALIB_CB_CLUSTERING):
            found, centres = cv2.findCirclesGrid(
                image, (board.columns, board.rows), flags=flags, blobDetector=_blob_detector(grey)
            )
            if found:
                grid = np.asarray(centres, dtype=float).reshape(board.rows, board.columns, 2)
                return _centroids(255.0 - image.astype(np.float64), grid)
    return None


def _blob_detector(grey: NDArray[np.uint8]):
    import cv2

    parameters = cv2.SimpleBlobDetector.Params()
    parameters.minArea, parameters.maxArea = 12.0, 0.05 * grey.size
    parameters.minDistBetweenBlobs = 3.0
    return cv2.SimpleBlobDetector.create(parameters)


def _centroids(brightness: FloatArray, grid: FloatArray) -> FloatArray:
    """Return each circle's centroid of light above its surroundings, in a window that ends between the circles."""
    points = grid.reshape(-1, 2)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 1e9 * np.eye(len(points))
    reach = 0.48 * apart.min(axis=1)
    height, width = brightness.shape
    result = points.copy()
    for k in range(len(points)):
        u, v = points[k]
        r = int(np.ceil(reach[k]))
        left, top = max(int(u) - r, 0), max(int(v) - r, 0)
        window = brightness[top : min(int(v) + r + 2, height), left : min(int(u) + r + 2, width)]
        rows, columns = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
        inside = (rows - v) ** 2 + (columns - u) ** 2 <= reach[k] ** 2
        dark, bright = np.percentile(window[inside], [5, 95])
        # Cut at a tenth of the contrast: noise of the ground must not pull the centroid.
        weight = np.where(inside, np.clip(window - dark - 0.1 * (bright - dark), 0, 0.8 * (bright - dark)), 0.0)
        total = weight.sum()
        if total > 0:
            result[k] = (weight * columns).sum() / total, (weight * rows).sum() / total
    return result.reshape(grid.shape)
