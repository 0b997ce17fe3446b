"""What the simulated scanner measures, in its own frame: z away from it, its plane of light at y = 0."""

import numpy as np

from calib_core.simulation.motion import FloatArray
from calib_core.simulation.scenarios import TcpScenario

STAND_RADIUS_MM = 6.0
TABLE_BELOW_MM = 110.0
CLOUD_PITCH_MM = 1.0
_GRAZING = 0.25  # circles smaller than this part of the sphere's: light so near its rim does not come back


def columns(options: TcpScenario) -> FloatArray:
    """Return the x of the sensor's columns, (N,), mm."""
    half = round(options.window_x_mm / options.pitch_mm)
    return options.pitch_mm * np.arange(-half, half + 1, dtype=np.float64)


def arc_points(center_mm: FloatArray, radius_mm: float, options: TcpScenario) -> FloatArray:
    """Return the points (N, 3) of the stripe on the sphere, without noise: at y = 0 and the sensor's columns.

    Parameters
    ----------
    center_mm : (3,)
        The sphere's centre in the laser frame.
    radius_mm : float
        The sphere's radius; nothing is returned where the plane of light misses it or grazes its rim.
    options : TcpScenario
        Columns, measuring range and the angle up to which the sphere returns light.
    """
    square = radius_mm**2 - center_mm[1] ** 2
    if square <= (_GRAZING * radius_mm) ** 2:
        return np.zeros((0, 3))
    x = columns(options)
    x = x[np.abs(x - center_mm[0]) <= np.sqrt(square) * np.sin(np.deg2rad(options.arc_deg))]
    xy = np.stack([x, np.zeros_like(x)], axis=1)
    return _in_range(_cap_above(xy, center_mm, radius_mm), options)


def cap_points(center_mm: FloatArray, radius_mm: float, options: TcpScenario) -> FloatArray:
    """Return the points (N, 3) of an area scanner on the sphere, without noise, on a grid of 1 mm in x and y."""
    limit = radius_mm * np.sin(np.deg2rad(options.arc_deg))
    steps = np.arange(-np.floor(limit), np.floor(limit) + 1) * CLOUD_PITCH_MM
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(grid[:, 0], grid[:, 1]) <= limit] + np.round(center_mm[:2])
    return _in_range(_cap_above(grid, center_mm, radius_mm), options)


def noisy(points_mm: FloatArray, center_mm: FloatArray, radius_mm: float, errors_mm: FloatArray) -> FloatArray:
    """Return points (N, 3) moved along z until their distances to the sphere are `errors_mm`, (N,)."""
    return _cap_above(points_mm[:, :2], center_mm, radius_mm + errors_mm)


def background_depths(
    x_mm: FloatArray, laser_from_base: FloatArray, sphere_center_in_base_mm: FloatArray
) -> FloatArray:
    """Return the z (N,) at which the columns meet the stand below the sphere or the table; NaN where neither.

    Parameters
    ----------
    x_mm : (N,)
    laser_from_base : (4, 4)
    sphere_center_in_base_mm : (3,)
        The stand is an upright cylinder below it, the table a horizontal plane.
    """
    rotation = laser_from_base[:3, :3]
    origins = np.stack([x_mm, np.zeros_like(x_mm), np.zeros_like(x_mm)], axis=1)
    starts = (origins - laser_from_base[:3, 3]) @ rotation - sphere_center_in_base_mm  # in base, about the centre
    ray = rotation[2]
    table = (-TABLE_BELOW_MM - starts[:, 2]) / ray[2] if abs(ray[2]) > 1e-6 else np.full(len(x_mm), np.nan)
    across = float(ray[:2] @ ray[:2])
    half = starts[:, :2] @ ray[:2]
    root = half**2 - across * ((starts[:, :2] ** 2).sum(axis=1) - STAND_RADIUS_MM**2)
    stand = (-half - np.sqrt(np.where(root > 0, root, np.nan))) / max(across, 1e-12)
    height = starts[:, 2] + stand * ray[2]
    stand = np.where((height < 0) & (height > -TABLE_BELOW_MM), stand, np.nan)
    # The table ends beside the sphere: the stripe runs over its edge.
    edge = starts[:, 0] + table * ray[0]
    return np.fmin(stand, np.where(edge < 30.0, table, np.nan))


def _cap_above(xy_mm: FloatArray, center_mm: FloatArray, radius_mm: float | FloatArray) -> FloatArray:
    """Return the points (N, 3) at given x and y on the sphere's half that faces the scanner."""
    d = xy_mm - center_mm[:2]
    z = center_mm[2] - np.sqrt(radius_mm**2 - (d**2).sum(axis=1))
    return np.column_stack([xy_mm, z])


def _in_range(points_mm: FloatArray, options: TcpScenario) -> FloatArray:
    z = points_mm[:, 2]
    return points_mm[(z >= options.window_near_mm) & (z <= options.window_far_mm)]
