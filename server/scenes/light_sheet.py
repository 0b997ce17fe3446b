"""The plane of light as far as it reaches: from its source to the profile that it met."""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

_FAN_RAYS = 24


def fan_of_profile(points_in_laser_mm: FloatArray) -> tuple[FloatArray, NDArray[np.uint32]]:
    """Return where the light passed, corners (N, 3) in L and triangles: from its source to the arc that it met.

    It comes from the side to which the arc bulges, whichever way the scanner counts z.  Where the origin lies well
    on that side it is taken for the source; else (an origin in the middle of the measuring range) the source is
    not known, and a band comes from there.
    """
    order = np.argsort(points_in_laser_mm[:, 0])
    arc = points_in_laser_mm[order[np.linspace(0, len(order) - 1, _FAN_RAYS).astype(int)]]
    x, z = points_in_laser_mm[order, 0], points_in_laser_mm[order, 2]
    middle = np.abs(x - (x[0] + x[-1]) / 2) < np.ptp(x) / 4
    bulges_down = not middle.any() or middle.all() or z[middle].mean() <= z[~middle].mean()
    onwards = 1.0 if bulges_down else -1.0
    width, near = float(np.ptp(x)), float((z * onwards).min())
    source = np.zeros_like(arc)
    if near <= width:
        source[:, 0], source[:, 2] = arc[:, 0], onwards * (near - width)
    ray = np.arange(_FAN_RAYS - 1)
    lower = np.stack([ray, _FAN_RAYS + ray, _FAN_RAYS + ray + 1], axis=1)
    upper = np.stack([ray, _FAN_RAYS + ray + 1, ray + 1], axis=1)
    faces = lower if near > width else np.concatenate([lower, upper])
    return np.concatenate([source, arc]), faces.astype(np.uint32)
