"""The rim of a sphere in a camera's frame, where a stripe is not seen as wide as it is.

Light is some tenths of a millimetre thick. Near the rim a part of it falls behind the horizon, the camera's on one
side of the sphere and the light's on the other, and the middle of what is left lies beside the plane: by 0.01 mm
at 75° and by 0.05 mm at 82° for a sheet of 0.15 mm, at the arc's ends alone, as a bent sheet would do it.
"""

from dataclasses import replace

import numpy as np

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit, fit_arc

_STEEPEST_COS = float(np.cos(np.deg2rad(75.0)))


def without_rim(points_mm: FloatArray, arc: ArcFit, sphere_radius_mm: float, eye_mm: FloatArray) -> ArcFit:
    """Return an arc fitted without the points that are seen too steeply; the same where too few would be left.

    Parameters
    ----------
    points_mm : (N, 2)
        The profile, x and z in L.
    arc : ArcFit
        Its arc. On which side of the light the sphere's middle lies is not known: either counts.
    sphere_radius_mm : float
    eye_mm : (3,)
        The camera's centre in L.
    """
    points = np.insert(points_mm, 1, 0.0, axis=1)
    rays = eye_mm - points
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    height_mm = float(np.sqrt(max(sphere_radius_mm**2 - arc.radius_mm**2, 0.0)))
    x, z = arc.center_mm
    cosines = [np.sum((points - [x, side * height_mm, z]) * rays, axis=1) / sphere_radius_mm for side in (-1, 1)]
    steep = arc.inliers & (np.min(cosines, axis=0) < _STEEPEST_COS)
    if not steep.any():
        return arc
    left = np.where(steep[:, None], np.nan, points_mm)
    try:
        fitted = fit_arc(left, 2 * sphere_radius_mm, "away" if arc.visible_side > 0 else "toward")
    except MeasurementError:
        return arc
    return replace(fitted, extent_rad=arc.extent_rad)
