"""A simulated part: a block with a free-form top, sharp edges, a step, two holes, and a sphere on a post.

The truth is the mesh itself: rays are traced against its triangles, so what a perfect scan would measure is this
surface exactly.
"""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

LENGTH_MM, WIDTH_MM, HEIGHT_MM = 96.0, 64.0, 30.0
CELL_MM = 2.0
STEP_MM = 6.0
"""The top is higher by this where x > 24 mm: a sharp step."""

HOLES = ((-32.0, 12.0, 8.0), (8.0, -14.0, 6.0))
"""x, y and radius of the holes through the block, mm."""

BALL_RADIUS_MM = 10.0
BALL_MM = (-16.0, -16.0, 52.0)
_POST_RADIUS_MM = 4.0
_STEP_AT_MM = 24.0
_AROUND = 48  # corners of a hole; a square of 12×12 cells about it has as many


@dataclass(frozen=True, eq=False)
class PartMesh:
    """The part's surface in T.

    Parameters
    ----------
    points_mm : (N, 3)
    triangles : (M, 3)
        Counter-clockwise from outside.
    ball_center_mm : (3,)
    ball_radius_mm : float
    """

    points_mm: FloatArray
    triangles: IndexArray
    ball_center_mm: FloatArray = field(default_factory=lambda: np.zeros(3))
    ball_radius_mm: float = 0.0


def top_mm(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the height of the free-form top, without the step."""
    return HEIGHT_MM + 3 * np.sin(x / 14) * np.cos(y / 11) + 0.0006 * x * y


@cache
def build_part() -> PartMesh:
    """Return the part, standing on z = 0 of T about its axis; one for all, its arrays not to be written."""
    pieces = [*_walls(), *_tops(), *_holes(), _ball(), _post()]
    points = np.concatenate([corners.reshape(-1, 3) for corners in pieces])
    unique, index = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    triangles = index.reshape(-1, 3)
    solid = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    part = PartMesh(unique, triangles[solid], np.array(BALL_MM), BALL_RADIUS_MM)
    for array in (part.points_mm, part.triangles, part.ball_center_mm):
        array.flags.writeable = False
    return part


def _height(x: FloatArray, y: FloatArray, raised: bool) -> FloatArray:
    return top_mm(x, y) + (STEP_MM if raised else 0.0)


def _quads(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the triangles (M, 3, 3) of four-sided cells with corners (…, 3) counter-clockwise from outside."""
    a, b, c, d = (corner.reshape(-1, 3) for corner in (a, b, c, d))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _sheet(grid: FloatArray) -> FloatArray:
    """Return the triangles of a sheet of points (P, Q, 3), seen from where rows × columns points to."""
    return _quads(grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])


def _axis(low: float, high: float) -> FloatArray:
    return np.linspace(low, high, round((high - low) / CELL_MM) + 1)


def _tops() -> list[FloatArray]:
    """Return the top: cells outside of the holes' squares, and rings between square and hole."""
    pieces: list[FloatArray] = []
    for low, high, raised in ((-LENGTH_MM / 2, _STEP_AT_MM, False), (_STEP_AT_MM, LENGTH_MM / 2, True)):
        x, y = np.meshgrid(_axis(low, high), _axis(-WIDTH_MM / 2, WIDTH_MM / 2), indexing="ij")
        grid = np.stack([x, y, _height(x, y, raised)], axis=-1)
        middle_x, middle_y = x[:-1, :-1] + CELL_MM / 2, y[:-1, :-1] + CELL_MM / 2
        keep = np.ones(middle_x.shape, dtype=bool)
        for hole_x, hole_y, _ in HOLES:
            keep &= (np.abs(middle_x - hole_x) > 12) | (np.abs(middle_y - hole_y) > 12)
        corners = (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
        pieces.append(_quads(*(corner[keep] for corner in corners)))
    y = _axis(-WIDTH_MM / 2, WIDTH_MM / 2)
    low, high = (
        np.stack([np.full_like(y, _STEP_AT_MM), y, _height(y * 0 + _STEP_AT_MM, y, r)], -1) for r in (False, True)
    )
    pieces.append(_quads(low[1:], low[:-1], high[:-1], high[1:]))  # the riser looks toward −x
    return pieces


def _square_and_circle(hole: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    """Return corners (48, 2) around a hole's square of 24 mm, counter-clockwise, and the hole's beside them."""
    x, y, radius = hole
    side = np.arange(-12.0, 12.0, CELL_MM)
    full = np.full_like(side, 12.0)
    square = np.concatenate(
        [np.stack(pair, axis=1) for pair in ((side, -full), (full, side), (-side, full), (-full, -side))]
    )
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND + np.arctan2(-1, -1)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return square + np.array([x, y]), circle + np.array([x, y])


def _holes() -> list[FloatArray]:
    pieces: list[FloatArray] = []
    for hole in HOLES:
        square, circle = _square_and_circle(hole)
        steps = np.linspace(0, 1, 5)[:, None, None]
        rings = (1 - steps) * circle + steps * square  # (5, 48, 2)
        z = _height(rings[..., 0], rings[..., 1], raised=False)
        top = np.concatenate([rings, z[..., None]], axis=-1)
        top = np.concatenate([top, top[:, :1]], axis=1)
        pieces.append(_sheet(top))
        bottom = top[0] * (1, 1, 0)
        pieces.append(_quads(top[0, 1:], bottom[1:], bottom[:-1], top[0, :-1]))  # the wall looks inward
    return pieces


def _walls() -> list[FloatArray]:
    """Return the four sides down to z = 0; the part stands open, as no scan sees its underside."""
    x, y = _axis(-LENGTH_MM / 2, LENGTH_MM / 2), _axis(-WIDTH_MM / 2, WIDTH_MM / 2)
    half_x, half_y = LENGTH_MM / 2, WIDTH_MM / 2
    left, right = x[x <= _STEP_AT_MM], x[x >= _STEP_AT_MM]
    edges = [
        (left, np.full_like(left, -half_y), False), (right, np.full_like(right, -half_y), True),
        (np.full_like(y, half_x), y, True), (right[::-1], np.full_like(right, half_y), True),
        (left[::-1], np.full_like(left, half_y), False), (np.full_like(y, -half_x), y[::-1], False),
    ]  # fmt: skip
    pieces: list[FloatArray] = []
    for along_x, along_y, raised in edges:
        high = np.stack([along_x, along_y, _height(along_x, along_y, raised)], axis=-1)
        low = high * (1, 1, 0)
        pieces.append(_quads(low[:-1], low[1:], high[1:], high[:-1]))
    return pieces


def _ball() -> FloatArray:
    """Return the ball, down to where the post holds it; corners every 1.5°, at most 2 µm inside of the sphere."""
    lowest = np.pi - np.arcsin(_POST_RADIUS_MM / BALL_RADIUS_MM)
    down = np.linspace(0, lowest, 110)[:, None]
    around = np.linspace(0, 2 * np.pi, 241)[None, :]
    unit = np.stack(
        [np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down) * np.ones_like(around)],
        axis=-1,
    )
    return _sheet(np.array(BALL_MM) + BALL_RADIUS_MM * unit)


def _post() -> FloatArray:
    """Return the post from inside the block up to the ball."""
    high = BALL_MM[2] - np.sqrt(BALL_RADIUS_MM**2 - _POST_RADIUS_MM**2)
    around = np.linspace(0, 2 * np.pi, 61)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1) * _POST_RADIUS_MM + BALL_MM[:2]
    low = np.column_stack([circle, np.full(61, HEIGHT_MM - 8)])
    top = np.column_stack([circle, np.full(61, high)])
    return _quads(low[:-1], low[1:], top[1:], top[:-1])
