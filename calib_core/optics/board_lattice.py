"""Corners of squares in a frame, and how they follow each other: a chessboard, or what is seen of one."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.optics.board_refusal import shrunk

Grey = NDArray[np.uint8]

_SMOOTHED_PX = 1.5
_RING_PX, _RING = 5.0, 16
_LEAST_SHARE = 0.02  # of the strongest saddles' strength
_LEAST_STRENGTH = 0.1  # grey values² / px⁴: noise of one or two makes a tenth of it
_STRONGEST = 30
_NEARLY_ALL = 0.85
_MOST_CORNERS = 800
_MOST_UNLIKE = 0.6  # what opposite sides of a corner differ by, over its contrast
_ASIDE = 0.3  # rad: how far beside a corner's edge the next one may stand
_SKEW = 0.45  # rad: between the edges of neighbours
_NEIGHBOURS = 12
_FEWEST = 3


def lattices(grey: Grey) -> list[FloatArray]:
    """Return the corners of the chessboards in a frame, or of parts of them, the largest first.

    Where the frame shows none as it is, as blurred and noisy ones do not, it is looked at from farther away.

    Returns
    -------
    list of (rows, columns, 2)
        Three rows and columns or more; some tenths of a pixel off, NaN where a corner is not seen, px.
    """
    import cv2

    small, factor = shrunk(grey)
    found = _lattices_at(small)
    if not found or np.isfinite(found[0][..., 0]).mean() < _NEARLY_ALL:
        half = cv2.resize(small, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        farther = [(grid + 0.5) * 2 - 0.5 for grid in _lattices_at(np.asarray(half, dtype=np.uint8))]
        found = max(found, farther, key=_most_corners)
    return [(grid + 0.5) * factor - 0.5 for grid in found]


def _most_corners(grids: list[FloatArray]) -> int:
    return max((int(np.isfinite(grid[..., 0]).sum()) for grid in grids), default=0)


def _lattices_at(grey: Grey) -> list[FloatArray]:
    points, hessians = _saddles(grey)
    if len(points) < _FEWEST**2:
        return []
    return [grid for grid in _joined(points, _neighbours(points, hessians)) if min(grid.shape[:2]) >= _FEWEST]


def _saddles(grey: Grey) -> tuple[FloatArray, FloatArray]:
    """Return where grey values have a saddle as at a corner of squares (N, 2), and their second derivatives."""
    import cv2

    blurred = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), _SMOOTHED_PX)
    smooth = np.asarray(blurred, dtype=np.float32)
    xx, yy, xy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1)))
    xx, yy, xy = xx / 4, yy / 4, xy / 4
    strength = xy * xy - xx * yy
    peaks = strength == cv2.dilate(strength, np.ones((5, 5), np.uint8))
    margin = int(_RING_PX) + 2
    peaks[:margin] = peaks[-margin:] = False
    peaks[:, :margin] = peaks[:, -margin:] = False
    v, u = np.nonzero(peaks & (strength > _LEAST_STRENGTH))
    v, u = _like_corners(smooth, v, u)
    found = strength[v, u]
    if len(found) < _FEWEST**2:
        return np.zeros((0, 2)), np.zeros((0, 2, 2))
    order = np.argsort(-found)[:_MOST_CORNERS]
    order = order[found[order] > _LEAST_SHARE * float(np.median(found[order[:_STRONGEST]]))]
    v, u = v[order], u[order]
    hessians = np.stack([xx[v, u], xy[v, u], xy[v, u], yy[v, u]], axis=1).reshape(-1, 2, 2).astype(float)
    across, down = smooth[v, u + 1] - smooth[v, u - 1], smooth[v + 1, u] - smooth[v - 1, u]
    slopes = np.stack([across, down], axis=1).astype(float) / 2
    level = -np.linalg.solve(hessians, slopes[:, :, None])[:, :, 0]
    return np.stack([u, v], axis=1) + np.clip(level, -1.0, 1.0), hessians


def _like_corners(smooth: NDArray[np.float32], v: NDArray[np.int64], u: NDArray[np.int64]):
    """Return those pixels around which dark and bright follow each other twice, opposite sides alike."""
    angles = 2 * np.pi * np.arange(_RING) / _RING
    rows = np.rint(v[:, None] + _RING_PX * np.sin(angles)).astype(int)
    columns = np.rint(u[:, None] + _RING_PX * np.cos(angles)).astype(int)
    ring = smooth[rows, columns]
    off = ring - (ring.max(axis=1, keepdims=True) + ring.min(axis=1, keepdims=True)) / 2
    changes = (np.sign(off) != np.sign(np.roll(off, 1, axis=1))).sum(axis=1)
    unlike = np.abs(ring - np.roll(ring, _RING // 2, axis=1)).mean(axis=1)
    good = (changes == 4) & (unlike < _MOST_UNLIKE * np.ptp(ring, axis=1) / 2)
    return v[good], u[good]


def _neighbours(points: FloatArray, hessians: FloatArray) -> list[list[int]]:
    """Return of each corner which follow it along its edges: ahead, to one side, back, to the other; −1: none."""
    from scipy.spatial import KDTree

    edges = _edges(hessians)
    near = np.asarray(KDTree(points).query(points, k=min(_NEIGHBOURS + 1, len(points)))[1])[:, 1:]
    steps = points[near] - points[:, None]
    bisectors = edges.sum(axis=1)
    own = np.einsum("ni,nij,nj->n", bisectors, hessians, bisectors)
    bends = np.einsum("ni,nkij,nj->nk", bisectors, hessians[near], bisectors)
    alike = np.abs(np.einsum("nkai,nbi->nkab", edges[near], edges))
    straight = np.minimum(alike[..., 0, 0], alike[..., 1, 1])
    exchanged = np.minimum(alike[..., 0, 1], alike[..., 1, 0])
    good = (np.maximum(straight, exchanged) > np.cos(_SKEW)) & (bends * own[:, None] < 0)
    along = np.einsum("nki,ndi->ndk", steps, np.concatenate([edges, -edges], axis=1))
    fits = good[:, None] & (along > np.cos(_ASIDE) * np.linalg.norm(steps, axis=2)[:, None])
    first = np.take_along_axis(near, fits.argmax(axis=2), axis=1)
    return np.where(fits.any(axis=2), first, -1).tolist()


def _edges(hessians: FloatArray) -> FloatArray:
    """Return the directions (N, 2, 2) of the two edges that cross in each saddle: there it does not bend."""
    mean = np.arctan2(2 * hessians[:, 0, 1], hessians[:, 0, 0] - hessians[:, 1, 1]) / 2  # of the steepest bend
    trace, half = (
        hessians[:, 0, 0] + hessians[:, 1, 1],
        np.hypot((hessians[:, 0, 0] - hessians[:, 1, 1]) / 2, hessians[:, 0, 1]),
    )
    aside = np.arccos(np.clip(-trace / (2 * half), -1, 1)) / 2
    angles = np.stack([mean - aside, mean + aside], axis=1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=2)


def _joined(points: FloatArray, neighbours: list[list[int]]) -> list[FloatArray]:
    """Return the sets of corners that follow each other, in their rows and columns, the largest first."""
    free, sets = set(range(len(points))), list[dict[tuple[int, int], int]]()
    for start in range(len(points)):
        if start in free:
            places = _connected(start, neighbours, free)
            free -= set(places.values())
            sets.append(places)
    grids: list[FloatArray] = []
    for places in sorted(sets, key=len, reverse=True):
        if len(places) < _FEWEST**2:
            break
        where = np.array(list(places))
        where -= where.min(axis=0)
        grid = np.full((*(where.max(axis=0) + 1), 2), np.nan)
        grid[where[:, 0], where[:, 1]] = points[list(places.values())]
        grids.append(grid)
    return grids


def _connected(start: int, neighbours: list[list[int]], free: set[int]) -> dict[tuple[int, int], int]:
    """Return the free corners that a first one leads to, by row and column; neighbours name each other."""
    places, turned = {(0, 0): start}, {start: 0}
    waiting = deque([((0, 0), start)])
    while waiting:
        (row, column), here = waiting.popleft()
        for side, other in enumerate(neighbours[here]):
            if other not in free or other in turned or here not in neighbours[other]:
                continue
            # The other one's own first edge may point another way: it sees this one at its back.
            turn = (side + 2 - neighbours[other].index(here) + turned[here]) % 4
            step = ((0, 1), (1, 0), (0, -1), (-1, 0))[(side + turned[here]) % 4]
            place = row + step[0], column + step[1]
            if place not in places:
                places[place], turned[other] = other, turn
                waiting.append((place, other))
    return places
