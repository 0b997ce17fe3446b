"""Signs that several layers use: a cross for what was rejected, and the short form of its reason."""

import re

import numpy as np

from calib_core.frames import FloatArray

_LONGEST_REASON = 64


def cross(at_mm: FloatArray, size_mm: float) -> FloatArray:
    """Return a cross in space (4, 2, 3): the diagonals of a cube, a cross from wherever one looks."""
    corners = np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]], dtype=float) * size_mm / np.sqrt(3)
    return at_mm + np.stack([corners, -corners], axis=1)


def short(reason: str) -> str:
    """Return the first clause of a reason without what stands in brackets, short enough for a label."""
    clause = re.split(r"[.,;:](?:\s|$)", re.sub(r"\s*\([^)]*\)", "", reason), maxsplit=1)[0]
    return clause if len(clause) <= _LONGEST_REASON else clause[: _LONGEST_REASON - 1].rstrip() + "…"
