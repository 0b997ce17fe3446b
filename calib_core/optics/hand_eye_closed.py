"""Hand and eye in closed form, in time that grows with the number of captures and not with that of their pairs.

A X = Z B for every capture: A = base_from_tool0, X = tool0_from_camera, Z = base_from_board and
B = board_from_camera.  Of the rotations, vec(R_Z) = (R_B ⊗ R_A) vec(R_X): summed over the captures, the leading
singular vectors of that 9 × 9 matrix are both (after M. Shah, J. Mechanisms and Robotics 5 (2013) 031007); the
translations are then linear.
"""

import numpy as np

from calib_core.errors import MotionError
from calib_core.frames import FloatArray, nearest_rotation
from calib_core.messages import plural


def solve_ax_zb(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return X and Z, (4, 4) each, with A X = Z B.

    Parameters
    ----------
    a, b : (K, 4, 4)
        At least three, turned about axes that are not parallel.

    Raises
    ------
    MotionError
        If the turns do not determine the rotations.
    """
    left, strengths, right = np.linalg.svd(_summed(a, b))
    _require_one(strengths, len(a))
    of_x, of_z = right[0].reshape(3, 3).T, left[:, 0].reshape(3, 3).T
    sign = np.sign(np.linalg.det(of_x)) or 1.0
    x, z = (np.asarray(nearest_rotation(sign * r), dtype=float) for r in (of_x, of_z))
    design = np.concatenate([a[:, :3, :3], np.broadcast_to(-np.eye(3), (len(a), 3, 3))], axis=2)
    shift = b[:, :3, 3] @ z.T - a[:, :3, 3]
    t = _least_squares(design, shift)
    return _joined(x, t[:3]), _joined(z, t[3:])


def _summed(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the sum of R_B ⊗ R_A, (9, 9), for matrices written by columns."""
    flat_a, flat_b = a[:, :3, :3].reshape(-1, 9), b[:, :3, :3].reshape(-1, 9)
    return (flat_b.T @ flat_a).reshape(3, 3, 3, 3).transpose(0, 2, 1, 3).reshape(9, 9)


def _require_one(strengths: FloatArray, count: int) -> None:
    """Raise where a second pair of rotations explains the turns almost as well."""
    if count < 3 or strengths[0] - strengths[1] < 1e-4 * count:
        raise MotionError(
            "at least three captures of the board at robot poses turned about axes that are not parallel",
            plural(
                "{count} capture, turned about one axis or hardly at all",
                "{count} captures, turned about one axis or hardly at all",
                by="count",
                count=count,
            )
            if count >= 3
            else f"{count}",
            "Take the lit board with the flange turned by 20° about different axes.",
            "captures",
        )


def _least_squares(design: FloatArray, right: FloatArray) -> FloatArray:
    normal = np.einsum("kij,kil->jl", design, design)
    return np.linalg.solve(normal, np.einsum("kij,ki->j", design, right))


def _joined(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix
