"""Rotations from three angles or a quaternion, and back, exact at gimbal lock too."""

import numpy as np
from numpy.typing import ArrayLike

from calib_core.frames import FloatArray

_LOCKED = 1e-9  # the sine below which the first and the last axis are taken as one

_NEXT = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}


def about(axis: str, angle_rad: float) -> FloatArray:
    """Return the right-handed rotation (3, 3) about the axis "X", "Y" or "Z"."""
    i, j = _NEXT[axis]
    rotation = np.eye(3)
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    rotation[i, i] = rotation[j, j] = c
    rotation[i, j], rotation[j, i] = -s, s
    return rotation


def rotation_from_angles(axes: str, angles_rad: ArrayLike) -> FloatArray:
    """Return the product (3, 3), from left to right, of the rotations about three axes.

    Parameters
    ----------
    axes : {"ZYX", "XYZ", "ZYZ"}
    angles_rad : (3,)
    """
    a, b, c = np.asarray(angles_rad, dtype=float)
    return about(axes[0], a) @ about(axes[1], b) @ about(axes[2], c)


def angles_from_rotation(axes: str, rotation: FloatArray) -> FloatArray:
    """Return the three angles (3,), rad, whose product `rotation_from_angles` is a rotation (3, 3).

    The first and last are in [−π, π]; the middle one is in [−π/2, π/2], for ZYZ in [0, π].  At gimbal lock, where
    the first and the last axis coincide, the first angle is 0.
    """
    v = rotation[:, "XYZ".index(axes[2])]  # the last axis: only the first two turns move it
    across, along = (-v[1], v[2]) if axes == "XYZ" else (v[1], v[0])
    first = float(np.arctan2(across, along)) if np.hypot(across, along) > _LOCKED else 0.0
    # What is left when the turns found are taken off is exact, however near the lock is.
    rest = about(axes[0], first).T @ rotation
    w = rest[:, "XYZ".index(axes[2])]
    middle = float(np.arctan2(-w[2], w[0]) if axes[2] == "X" else np.arctan2(w[0], w[2]))
    rest = about("Y", middle).T @ rest
    i, j = _NEXT[axes[2]]
    return np.array([first, middle, float(np.arctan2(rest[j, i], rest[i, i]))])


def rotation_from_quaternion(quaternion_xyzw: ArrayLike) -> FloatArray:
    """Return the rotation (3, 3) of a quaternion (4,), scalar last, of any length but zero."""
    q = np.asarray(quaternion_xyzw, dtype=float)
    x, y, z, w = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: FloatArray) -> FloatArray:
    """Return the unit quaternion (4,), scalar last and not negative, of a rotation (3, 3).

    The products of the largest component with the others are read off the matrix (Shepperd), so nothing cancels.
    """
    m = rotation
    squares = np.array([m[0, 0], m[1, 1], m[2, 2], m.trace()])
    largest = int(np.argmax(squares))
    w_products = (m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])
    if largest == 3:
        q = np.array([*w_products, 1 + squares[3]])
    else:
        j, k = _NEXT["XYZ"[largest]]
        q = np.zeros(4)
        q[largest] = 1 + m[largest, largest] - m[j, j] - m[k, k]
        q[j] = m[largest, j] + m[j, largest]
        q[k] = m[largest, k] + m[k, largest]
        q[3] = w_products[largest]
    q /= np.linalg.norm(q)
    return -q if q[3] < 0 else q
