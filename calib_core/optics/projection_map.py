"""Maps over the image: where a camera's boards were not seen, and how far two calibrations lie apart."""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.coverage_cells import CELLS

_SMALL_TURN_RAD = 1e-5
_MOST_STEPS = 10


def nodes(image_size: tuple[int, int], fine: int = 1) -> FloatArray:
    """Return the corners of the image's cells, its border with them, (63, 2) px; of `fine` parts of each."""
    axes = [
        np.linspace(-0.5, length - 0.5, fine * count + 1) for length, count in zip(image_size, CELLS, strict=True)
    ]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)


def as_map(values: FloatArray, has_ray: np.ndarray) -> FloatArray:
    """Return values of the nodes that have a ray as a map (7, 9), NaN elsewhere."""
    whole = np.full(len(has_ray), np.nan)
    whole[has_ray] = values
    return whole.reshape(CELLS[1] + 1, CELLS[0] + 1)


def turns_of(camera: CameraModel, points: FloatArray) -> FloatArray:
    """Return how points' pixels follow a small turn of the scene about each axis, (N, 2, 3)."""
    still = camera.project(points)
    turned = [camera.project(points + np.cross(axis, points)) for axis in _SMALL_TURN_RAD * np.eye(3)]
    return np.stack([(one - still) / _SMALL_TURN_RAD for one in turned], axis=-1)


def projection_difference(left: CameraModel, right: CameraModel) -> FloatArray:
    """Return how far the rays of one camera's pixels end from there in another, as a map (7, 9), px.

    The turn between the two that fits best is taken off: what looks along a ray another way is no error of a lens.
    NaN stands where a pixel has no ray.
    """
    pixels = nodes(left.image_size)
    depth_mm = float(np.median([one.near_mm for one in left.segments])) if left.segments else 1.0
    rays = np.column_stack([left.undistort(pixels, depth_mm), np.ones(len(pixels))]) * depth_mm
    has_ray = np.asarray(np.isfinite(rays).all(axis=1))
    points, pixels = rays[has_ray], pixels[has_ray]
    for _ in range(_MOST_STEPS):
        off = right.project(points) - pixels
        step = np.linalg.lstsq(turns_of(right, points).reshape(-1, 3), -off.ravel(), rcond=None)[0]
        points = points + np.cross(step, points)
    return as_map(np.linalg.norm(right.project(points) - pixels, axis=1), has_ray)
