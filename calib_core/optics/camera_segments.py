"""Bands of depth for a segmental camera: as many as the views can carry, overlapping wholly."""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.optics.adjust import Corners, State

_LEAST_DEPTH_RATIO = 1.25  # farthest over nearest corner: below, one set of coefficients holds for all
_LEAST_CORNERS = 200
_LEAST_VIEWS = 4


def corner_depths(corners: Corners, state: State) -> FloatArray:
    """Return the depth z of every corner in the camera frame, (N,), mm."""
    views = corners.view_of_each
    return np.einsum("nj,nj->n", state.rotations[views, 2], corners.points_mm) + state.translations[views, 2]


def depth_bands(corners: Corners, state: State, most: int) -> tuple[FloatArray, FloatArray] | None:
    """Return the bands' near and far ends (B,), mm, or None where the views do not span enough depth.

    Each band reaches from the middle of the one before it to the middle of the one after, so that the coefficients
    run linearly from middle to middle and nowhere make a step. The middles are equally
    far apart in inverse depth, the quantity in which an image changes evenly. Each band must hold 200 corners of
    four views, else there are fewer bands.
    """
    depths = corner_depths(corners, state)
    near, far = float(depths.min()), float(depths.max())
    if not near > 0 or far < _LEAST_DEPTH_RATIO * near:
        return None
    views = corners.view_of_each
    for count in range(most, 1, -1):
        middles = 1 / np.linspace(1 / near, 1 / far, count)
        nears = np.concatenate([middles[:1], middles[:-1]])
        fars = np.concatenate([middles[1:], middles[-1:]])
        inside = [(depths >= a) & (depths <= b) for a, b in zip(nears, fars, strict=True)]
        if all(i.sum() >= _LEAST_CORNERS and len(np.unique(views[i])) >= _LEAST_VIEWS for i in inside):
            return nears, fars
    return None
