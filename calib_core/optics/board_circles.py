"""Grids of circles, symmetric and asymmetric, dark on bright and bright on dark."""

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.optics.adjust import Corners
from calib_core.optics.board_refusal import BRING_WHOLE, MIRRORED, board_words, grey_levels, other_board
from calib_core.optics.camera_start import homographies
from calib_core.optics.circle_lattice import CircleGrid, circle_grid
from calib_core.records import Board

_LEAST_APART_PX = 3.0
_FOLLOWS = 0.3  # of the distance between circles: a lens bends a grid by less
_ROUND = 0.82  # of a circle's area at its outline; a square has 0.785
_GROUNDS, _DARKER = 12, 0.05  # of the frame's width and contrast: a circle's ground, and how much darker it is
_SHORTEST_PX = 10
_LEAST_WHITE = 12
_NEARLY_WHITE = 0.85
_EVEN = 0.03  # of the brightness: a plane's own error is as large


def find_circles(grey: NDArray[np.uint8], board: Board, places_mm: FloatArray) -> FloatArray | None:
    """Return the circles' centres as (rows, columns, 2), px, or None where the grid is not seen.

    Each is the centroid of the circle's darkness (brightness), put from the middle of the ellipse that is seen to
    where the circle's own centre is seen: under perspective those differ.

    Parameters
    ----------
    grey : (H, W)
    board : Board
    places_mm : (rows · columns, 3)
        Where the circles stand on the board, row by row.
    """
    seen: list[CircleGrid] = []
    for dark in (True, False):
        image = np.asarray(grey if dark else 255 - grey, dtype=np.uint8)
        spots = _spots(image)
        grid = circle_grid(spots)
        told = None if grid is None else grid.told(board)
        if told is None and len(spots) >= len(places_mm) and (grid is None or grid.count <= len(places_mm)):
            told = _searched(image, board, places_mm)
        if told is not None:
            centroids, areas_px = _centroids(grey.astype(np.float64), told, dark=dark)
            return _seen_centers(centroids.reshape(-1, 2), areas_px, places_mm).reshape(told.shape)
        seen += [] if grid is None else [grid]
    if seen:
        _refuse_other_grid(max(seen, key=lambda one: one.count), grey, board)
    return None


def seen_circles(grey: NDArray[np.uint8]) -> CircleGrid | None:
    """Return the grid of circles that a frame shows, whatever was told; None where it shows none."""
    return circle_grid(_round_outlines(grey))


def _round_outlines(grey: NDArray[np.uint8]) -> FloatArray:
    """Return middles and widths (N, 3), px, of round outlines, dark or bright: at once, unlike `_spots`."""
    import cv2

    dark, bright = grey_levels(grey, [1, 99])
    ground = cv2.blur(grey, (max(grey.shape) // _GROUNDS | 1,) * 2)
    darker = (ground.astype(np.int16) - grey > _DARKER * (bright - dark)).astype(np.uint8)
    found: list[FloatArray] = []
    for outline in cv2.findContours(darker, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
        if len(outline) < _SHORTEST_PX:
            continue
        area = cv2.contourArea(outline)
        if 4 * np.pi * area > _ROUND * cv2.arcLength(outline, True) ** 2:
            found.append(np.append(outline[:, 0].mean(axis=0), np.sqrt(area)))
    return np.array(found, dtype=float).reshape(-1, 3)


def _refuse_other_grid(grid: CircleGrid, grey: NDArray[np.uint8], board: Board) -> None:
    """Raise MeasurementError: a grid that is seen is not the told one."""
    if grid.is_mirrored(board):
        raise MeasurementError(*MIRRORED)
    is_part = grid.count < board.columns * board.rows and grid.is_asymmetric == (
        board.kind == "asymmetric-circles"
    )
    if is_part and not grid.ends_in(grey):
        raise MeasurementError(board_words(board.kind, board.columns, board.rows), grid.words, BRING_WHOLE)
    raise other_board(board, grid.words)


def _searched(grey: NDArray[np.uint8], board: Board, places_mm: FloatArray) -> FloatArray | None:
    """Return the told grid of dark circles (rows, columns, 2) as OpenCV finds and completes it, or None."""
    import cv2

    layout = cv2.CALIB_CB_ASYMMETRIC_GRID if board.kind == "asymmetric-circles" else cv2.CALIB_CB_SYMMETRIC_GRID
    for flags in (layout, layout | cv2.CALIB_CB_CLUSTERING):
        found, centres = cv2.findCirclesGrid(
            grey, (board.columns, board.rows), flags=flags, blobDetector=_spot_detector(grey)
        )
        if found and _is_grid(np.asarray(centres, dtype=float).reshape(-1, 2), grey, places_mm):
            return np.asarray(centres, dtype=float).reshape(board.rows, board.columns, 2)
    return None


def _is_grid(points: FloatArray, grey: NDArray[np.uint8], places_mm: FloatArray) -> bool:
    """Whether points may be a grid at all: apart from each other, in the frame, as the flat board has them."""
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 1e9 * np.eye(len(points))
    inside = (points >= 0) & (points <= np.array(grey.shape[::-1]) - 1)
    if not inside.all() or apart.min() < _LEAST_APART_PX:
        return False
    onto = homographies(Corners.of([points], [places_mm]))[0]
    seen = (places_mm @ np.diag([1, 1, 0]) + [0, 0, 1]) @ onto.T
    off = np.linalg.norm(seen[:, :2] / seen[:, 2:] - points, axis=1)
    return float(np.median(off)) < _FOLLOWS * apart.min()


def _seen_centers(centroids: FloatArray, areas_px: FloatArray, places_mm: FloatArray) -> FloatArray:
    """Return where the circles' own centres are seen, from the middles of their ellipses, both (N, 2), px.

    By the homography H from the board to the image a circle becomes the ellipse whose dual conic is H C* Hᵀ, and
    its middle stands in that conic's last column.  The circles' radius, one for all, comes from the areas.
    """
    centers = centroids
    for _ in range(2):
        onto = homographies(Corners.of([centers], [places_mm]))[0]
        x, y = places_mm[:, 0], places_mm[:, 1]
        homogeneous = np.column_stack([x, y, np.ones_like(x)]) @ onto.T
        # The determinant of the map's derivative: that of H over the third power of the homogeneous part.
        px2_per_mm2 = np.abs(np.linalg.det(onto)) / np.abs(homogeneous[:, 2]) ** 3
        square = float(np.median(areas_px / px2_per_mm2)) / np.pi
        zero = np.zeros_like(x)
        radius = np.stack([zero + square, zero + square, zero], axis=1)
        dual = np.einsum("ij,nj,kj->nik", onto, radius, onto) - homogeneous[:, :, None] * homogeneous[:, None, :]
        middles = dual[:, :2, 2] / dual[:, 2:, 2]
        centers = centroids - (middles - homogeneous[:, :2] / homogeneous[:, 2:])
    return centers


def _spots(grey: NDArray[np.uint8]) -> FloatArray:
    """Return middles and widths (N, 3) of dark spots, px."""
    found = _spot_detector(grey).detect(grey)
    return np.array([(*spot.pt, spot.size) for spot in found], dtype=float).reshape(-1, 3)


def _spot_detector(grey: NDArray[np.uint8]):
    import cv2

    parameters = cv2.SimpleBlobDetector.Params()
    parameters.minArea, parameters.maxArea = 12.0, 0.05 * grey.size
    parameters.minDistBetweenBlobs = _LEAST_APART_PX
    return cv2.SimpleBlobDetector.create(parameters)


def _evenly_lit(window: FloatArray, inside: NDArray[np.bool_]) -> FloatArray:
    """Return grey values over what white would have there: a plane through the bright pixels inside a window.

    Light that falls off across a circle would draw its centroid to one side.
    """
    rows, columns = np.mgrid[: window.shape[0], : window.shape[1]]
    places = np.stack([np.ones(window.shape), rows - rows.mean(), columns - columns.mean()], axis=2)
    dark, bright = np.percentile(window[inside], [5, 95])
    white = inside & (window > (dark + bright) / 2)
    plane = np.full(window.shape, max(bright, 1.0))
    for _ in range(2):
        if white.sum() < _LEAST_WHITE:
            break
        plane = np.maximum(places @ np.linalg.lstsq(places[white], window[white], rcond=None)[0], 1.0)
        ratio = window / plane
        white = inside & (ratio > 0.5 * (1 + np.percentile(ratio[inside], 5)))
        white &= ratio > _NEARLY_WHITE
    if np.ptp(plane[inside]) < _EVEN * bright:
        plane = np.full(window.shape, max(bright, 1.0))
    return window / plane


def _centroids(grey: FloatArray, grid: FloatArray, dark: bool) -> tuple[FloatArray, FloatArray]:
    """Return each circle's centroid of what it differs from its ground by, in a window between circles; its area.

    `dark`: circles on a bright ground, else bright ones.
    """
    points = grid.reshape(-1, 2)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 1e9 * np.eye(len(points))
    reach = 0.48 * apart.min(axis=1)
    height, width = grey.shape
    result, areas = points.copy(), np.zeros(len(points))
    for k in range(len(points)):
        u, v = points[k]
        r = int(np.ceil(reach[k]))
        left, top = max(int(u) - r, 0), max(int(v) - r, 0)
        window = grey[top : min(int(v) + r + 2, height), left : min(int(u) + r + 2, width)]
        rows, columns = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
        inside = (rows - v) ** 2 + (columns - u) ** 2 <= reach[k] ** 2
        even = _evenly_lit(window, inside)
        even = -even if dark else even
        low, high = np.percentile(even[inside], [5, 95])
        # Cut at a tenth of the contrast: noise of the ground must not pull the centroid.
        weight = np.where(inside, np.clip(even - low - 0.1 * (high - low), 0, 0.8 * (high - low)), 0.0)
        total = weight.sum()
        if total > 0:
            result[k] = (weight * columns).sum() / total, (weight * rows).sum() / total
            areas[k] = total / (0.8 * (high - low))
    return result.reshape(grid.shape), areas
