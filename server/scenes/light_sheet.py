"""The plane of light as far as it reaches: from its source to the profile that it met."""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

_FAN_RAYS = 24
_HALF_WIDTH_MM, _HALF_DEPTH_MM, _HEIGHT_MM = 14.0, 6.0, 20.0  # of the scanner's body, as it is drawn


def fan_of_profile(points_in_laser_mm: FloatArray) -> tuple[FloatArray, NDArray[np.uint32]]:
    """Return where the light passed, corners (N, 3) in L and triangles: from its source to the arc that it met.

    It comes from the side to which the arc bulges, whichever way the scanner counts z.  Where the origin lies well
    on that side it is taken for the source; else (an origin in the middle of the measuring range) the source is
    not known, and a band comes from there.
    """
    arc, onwards, near, width = _seen(points_in_laser_mm)
    source = np.zeros_like(arc)
    if near <= width:
        source[:, 0], source[:, 2] = arc[:, 0], onwards * (near - width)
    ray = np.arange(_FAN_RAYS - 1)
    lower = np.stack([ray, _FAN_RAYS + ray, _FAN_RAYS + ray + 1], axis=1)
    upper = np.stack([ray, _FAN_RAYS + ray + 1, ray + 1], axis=1)
    faces = lower if near > width else np.concatenate([lower, upper])
    return np.concatenate([source, arc]), faces.astype(np.uint32)


def body_of_scanner(points_in_laser_mm: FloatArray) -> tuple[FloatArray, NDArray[np.uint32]] | None:
    """Return a small scanner behind its origin, corners (8, 3) in L and triangles.

    It is None where the light's source is not known.
    """
    _, onwards, near, width = _seen(points_in_laser_mm)
    if near <= width:
        return None
    signs = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)], dtype=float)
    rim = signs * [_HALF_WIDTH_MM, _HALF_DEPTH_MM]
    corners = np.concatenate(
        [np.column_stack([rim, np.full(4, height)]) for height in (0.0, -onwards * _HEIGHT_MM)]
    )
    sides = [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [0, 2, 3, 1], [4, 5, 7, 6]]
    faces = [triangle for a, b, c, d in sides for triangle in ([a, b, c], [a, c, d])]
    return corners, np.array(faces, dtype=np.uint32)


def _seen(points_in_laser_mm: FloatArray) -> tuple[FloatArray, float, float, float]:
    """Return some points of the arc in order, the sign of z away from the source, how near it comes, its width."""
    order = np.argsort(points_in_laser_mm[:, 0])
    arc = points_in_laser_mm[order[np.linspace(0, len(order) - 1, _FAN_RAYS).astype(int)]]
    x, z = points_in_laser_mm[order, 0], points_in_laser_mm[order, 2]
    middle = np.abs(x - (x[0] + x[-1]) / 2) < np.ptp(x) / 4
    bulges_down = not middle.any() or middle.all() or z[middle].mean() <= z[~middle].mean()
    onwards = 1.0 if bulges_down else -1.0
    return arc, onwards, float((z * onwards).min()), float(np.ptp(x))
