"""What is printed on a ChArUco board: its black squares and the black parts of its markers, as rectangles."""

from functools import lru_cache

import numpy as np

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom, mm, from the board's outer corner; y points down the board."""


@lru_cache(maxsize=8)
def charuco_rectangles(
    columns: int, rows: int, pitch_mm: float, marker_mm: float, dictionary: str
) -> tuple[Rectangle, ...]:
    """Return all that is black, without overlaps.

    The top left square is black; the markers stand in the white ones, numbered row by row.
    """
    import cv2

    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = words.markerSize + 2
    rectangles: list[Rectangle] = []
    marker = 0
    for row in range(rows):
        for column in range(columns):
            left, top = column * pitch_mm, row * pitch_mm
            if row % 2 == column % 2:
                rectangles.append((left, top, left + pitch_mm, top + pitch_mm))
                continue
            bits = np.asarray(cv2.aruco.generateImageMarker(words, marker, cells)) > 0
            marker += 1
            inset = (pitch_mm - marker_mm) / 2
            rectangles += [
                (left + inset + a, top + inset + b, left + inset + c, top + inset + d)
                for a, b, c, d in _black_runs(bits, marker_mm / cells)
            ]
    return tuple(rectangles)


def _black_runs(white: np.ndarray, cell_mm: float) -> list[Rectangle]:
    """Return the black cells of a marker, those that stand beside each other as one rectangle."""
    runs: list[Rectangle] = []
    for row, line in enumerate(white):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], ~line, [0]]).astype(int)))
        for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            runs.append((first * cell_mm, row * cell_mm, last * cell_mm, (row + 1) * cell_mm))
    return runs
