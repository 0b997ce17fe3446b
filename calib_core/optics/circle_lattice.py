"""How circles follow each other in a frame: which grid they form, whatever grid was told."""

from collections import deque
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.messages import Message
from calib_core.optics.board_refusal import board_words
from calib_core.records import Board

_FEWEST = 12
_NEAR = 0.3  # of a step: how far from where a neighbour is expected it may be
_WIDTHS = 1.8  # of neighbours: letters and dots beside a board are no circles of it
_ASIDE = 0.6  # sine of the angle between a grid's two directions, at least
_SEEDS = 3
_LEAST_ROW = 0.6  # of a row's circles: fewer on the grid's border are dirt
# Two neighbours may be one step along a row and one aside instead of one along each direction.
_SKEWS = [
    np.array(m)
    for m in ([[1, 0], [0, 1]], [[1, 1], [0, 1]], [[1, -1], [0, 1]], [[1, 0], [1, 1]], [[1, 0], [-1, 1]])
]
_DIAGONAL = np.array([[1, 1], [1, -1]])


@dataclass(frozen=True, eq=False)
class CircleGrid:
    """A grid of circles without gaps.

    Attributes
    ----------
    is_asymmetric : bool
    points_px : (rows, columns, 2)
        Where a circle is seen, y clockwise of x; half the places of an asymmetric grid are empty, NaN.
    outer_px : (N, 2)
        Where circles of a further row or column on each side would be.
    """

    is_asymmetric: bool
    points_px: FloatArray
    outer_px: FloatArray

    @property
    def count(self) -> int:
        """How many circles it has."""
        return int(np.isfinite(self.points_px[..., 0]).sum())

    @property
    def words(self) -> Message:
        """What it is called, columns and rows as `cell.board` counts them."""
        shapes = [grid.shape[1::-1] for grid in self._descriptions()]
        columns, rows = max(shapes, default=self.points_px.shape[1::-1])
        return board_words("asymmetric-circles" if self.is_asymmetric else "circles", columns, rows)

    def told(self, board: Board) -> FloatArray | None:
        """Return the circles (rows, columns, 2) of a board, None where it is another one.

        Where several ways round are possible its rows run to the image's right.
        """
        if self.is_asymmetric != (board.kind == "asymmetric-circles"):
            return None
        fitting = [grid for grid in self._descriptions() if grid.shape[:2] == (board.rows, board.columns)]
        return max(fitting, key=lambda grid: float((grid[:, -1] - grid[:, 0]).mean(axis=0)[0]), default=None)

    def is_mirrored(self, board: Board) -> bool:
        """Whether it is the mirror image of the grid that a board tells, and not that grid."""
        other = CircleGrid(self.is_asymmetric, self.points_px[:, ::-1], self.outer_px)
        return self.told(board) is None and other.told(board) is not None

    def ends_in(self, grey: NDArray[np.uint8]) -> bool:
        """Whether a further row and column on every side would be in the frame, too."""
        return bool(((self.outer_px >= 0) & (self.outer_px < grey.shape[::-1])).all())

    def _descriptions(self) -> list[FloatArray]:
        """Return the circles in rows and columns, in each of the ways that a board may be described."""
        found: list[FloatArray] = []
        for turns in range(4):
            grid = np.rot90(self.points_px, turns)
            if not self.is_asymmetric:
                found.append(grid)
            elif grid.shape[1] % 2 == 0 and np.isfinite(grid[0, 0, 0]):
                pairs = grid.reshape(len(grid), -1, 2, 2)
                found.append(np.stack([row[:, k % 2] for k, row in enumerate(pairs)]))
        return found


def circle_grid(circles: FloatArray) -> CircleGrid | None:
    """Return the grid of circles (N, 3), place and width, px; None where they form none, or one with gaps."""
    points = circles[:, :2]
    if len(points) < _FEWEST:
        return None
    near = np.argsort(np.linalg.norm(points - np.median(points, axis=0), axis=1))[:_SEEDS]
    followed = max((_followed(points, circles[:, 2], int(seed)) for seed in near), key=len)
    if len(followed) < _FEWEST:
        return None
    at, places = points[list(followed)], np.array(list(followed.values()))
    views = [(_turned(at, places @ skew.T), False) for skew in _SKEWS]
    views += [(_turned(at, places @ (_DIAGONAL @ skew).T), True) for skew in _SKEWS]
    filled = [_filled(_grid(at, cells), lattice) for cells, lattice in views]
    places, is_asymmetric = views[int(np.argmax(filled))]
    kept = _without_dirt(places)
    at, places = at[kept], places[kept]
    grid = _grid(at, places)
    if kept.sum() < _FEWEST or min(grid.shape[:2]) < 2 or _filled(grid, is_asymmetric) < 1:
        return None
    return CircleGrid(is_asymmetric, grid, _outer(at, places - places.min(axis=0)))


def _followed(points: FloatArray, widths: FloatArray, seed: int) -> dict[int, tuple[int, int]]:
    """Return the circles that follow each other from a first one on, by how many steps along each direction."""
    from scipy.spatial import KDTree

    tree = KDTree(points)
    near = np.asarray(tree.query(points[seed], k=min(9, len(points)))[1])[1:]
    first = points[near[0]] - points[seed]
    steps = points[near] - points[seed]
    sines = np.abs(steps @ [-first[1], first[0]]) / (np.linalg.norm(steps, axis=1) * np.linalg.norm(first))
    aside = np.flatnonzero(sines > _ASIDE)
    if not len(aside):
        return {}
    places = {seed: (0, 0)}
    taken = {(0, 0)}
    waiting = deque([(seed, (first, steps[aside[0]]))])
    while waiting:
        here, directions = waiting.popleft()
        for axis, sign in product((0, 1), (1, -1)):
            step = sign * directions[axis]
            distance, other = tree.query(points[here] + step)
            place = (places[here][0] + sign * (axis == 0), places[here][1] + sign * (axis == 1))
            if distance > _NEAR * np.linalg.norm(step) or int(other) in places or place in taken:
                continue
            if not 1 / _WIDTHS < widths[other] / widths[here] < _WIDTHS:
                continue
            taken.add(place)
            places[int(other)] = place
            own = sign * (points[other] - points[here])
            waiting.append((int(other), (own, directions[1]) if axis == 0 else (directions[0], own)))
    return places


def _turned(points: FloatArray, places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return places with y clockwise of x in the image."""
    onto, *_ = np.linalg.lstsq(np.column_stack([places, np.ones(len(places))]), points, rcond=None)
    return places if np.linalg.det(onto[:2]) > 0 else places * [-1, 1]


def _grid(points: FloatArray, places: NDArray[np.int64]) -> FloatArray:
    column, row = (places - places.min(axis=0)).T
    grid = np.full((int(row.max()) + 1, int(column.max()) + 1, 2), np.nan)
    grid[row, column] = points
    return grid


def _filled(grid: FloatArray, is_asymmetric: bool) -> float:
    """Return the share of its places where a grid has circles."""
    places = grid[..., 0].size
    return float(np.isfinite(grid[..., 0]).sum() / (places // 2 if is_asymmetric else places))


def _without_dirt(places: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which circles are left without rows and columns on the border of which few places are filled."""
    kept = np.ones(len(places), dtype=bool)
    for _ in range(4):
        before = kept.sum()
        for axis in (0, 1):
            if not kept.any():
                return kept
            lines, counts = np.unique(places[kept, axis], return_counts=True)
            usual = float(np.median(counts))
            for border in (lines[0], lines[-1]):
                if counts[lines == border][0] < _LEAST_ROW * usual:
                    kept &= places[:, axis] != border
        if kept.sum() == before:
            break
    return kept


def _outer(points: FloatArray, places: NDArray[np.int64]) -> FloatArray:
    """Return where circles of a further row or column on each of the four sides would be, (N, 2)."""
    import cv2

    onto, _ = cv2.findHomography(places.astype(float), points)
    columns, rows = places.max(axis=0) + 1
    above_and_below = product(range(columns), (-1, rows))
    flat = np.array([*above_and_below, *product((-1, columns), range(rows))], dtype=float)
    return np.asarray(cv2.perspectiveTransform(flat[None], np.asarray(onto, dtype=float))[0], dtype=float)
