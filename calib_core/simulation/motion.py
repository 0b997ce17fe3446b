"""Rotations for the simulated cell, written apart from the solvers' frames: neither can hide the other's error."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ON_FLANGE = "tool0_from_laser"
"""The name in records and truth of where a scanner on the flange is."""


def turn(vector_rad: ArrayLike) -> FloatArray:
    """Return the rotation (3, 3) about a vector (3,) by its length in rad, through its unit quaternion."""
    v = np.asarray(vector_rad, dtype=float)
    angle = float(np.sqrt(v @ v))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = v / angle * np.sin(angle / 2)
    w = np.cos(angle / 2)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose(rotation: FloatArray, translation_mm: ArrayLike) -> FloatArray:
    """Return the 4×4 matrix with a rotation (3, 3) and a translation (3,) in mm."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation_mm
    return matrix


def back(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a rigid 4×4 matrix."""
    return pose(matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3])


def quaternion_wxyz(rotation: FloatArray) -> FloatArray:
    """Return the unit quaternion (4,), scalar first and not negative, of a rotation (3, 3)."""
    m = rotation
    # The eigenvector of Bar-Itzhack's symmetric matrix: one formula for every rotation, without cases.
    k = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    q = np.linalg.eigh(k)[1][:, -1]
    return -q if q[0] < 0 else q
