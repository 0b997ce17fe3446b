"""How well a camera's projection is known over the image, where no board was seen, too."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray
from calib_core.optics.camera_layout import Layout, camera_of
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.coverage_cells import image_coverage
from calib_core.optics.projection_map import as_map, nodes, turns_of

if TYPE_CHECKING:
    from calib_core.optics.camera_solution import Fit

_RADIAL = (4, 5, 8)  # k1, k2 and k3 in the vector of shared parameters
_USUAL = (1.0, 3.0, 5.0)  # lenses have k2 and k3 of so many times k1² and k1³
_LEAST = 0.02  # of k1: a lens that seems to have none
_FINE = 8  # places between corners of cells
_STEP = 0.01  # of a standard deviation


def projection_sigmas(fit: "Fit", layout: Layout, image_size: tuple[int, int], seen: np.ndarray) -> FloatArray:
    """Return the projection's uncertainty at the corners of the image's cells, (7, 9) px; NaN where no ray is.

    A term of the lens that the boards do not ask for is zero, which holds for what they saw: beyond, it may be
    what is usual for lenses. A turn of the whole camera is no error of it: the one that fits the `seen` cells
    (6, 8) best is taken off.
    """
    lens = layout.free if len(layout.nears) > 1 else np.union1d(layout.free, _RADIAL)
    whole, shared = replace(layout, free=lens), fit.adjusted.state.shared
    known = whole.adjustment(fit.corners).equations(fit.adjusted.state).hessian
    scale = (fit.sigma_px * float(fit.corners.weights.max())) ** 2
    for term, (place, factor) in enumerate(zip(_RADIAL, _USUAL, strict=True), start=1):
        if place not in layout.free and place in lens:
            at = int(np.searchsorted(lens, place))
            known[at, at] += scale / (factor * max(abs(shared[_RADIAL[0]]), _LEAST) ** term) ** 2
    covariance = scale * covariance_of(known)
    camera, pixels = camera_of(shared, layout, image_size), nodes(image_size)
    depth_mm = float(np.median(fit.adjusted.state.translations[:, 2]))
    points = np.column_stack([camera.undistort(pixels, depth_mm), np.ones(len(pixels))]) * depth_mm
    has_ray = np.asarray(np.isfinite(points).all(axis=1))
    points = points[has_ray]

    def projected(place: int, step: float) -> FloatArray:
        moved = shared.copy()
        moved[place] += step
        return camera_of(moved, whole, image_size).project(points)

    steps = _STEP * np.sqrt(np.diag(covariance))
    slopes = np.stack(
        [(projected(i, s) - projected(i, -s)) / (2 * s) for i, s in zip(lens, steps, strict=True)], axis=-1
    )
    fitted = np.repeat(touching(seen)[has_ray], 2)
    terms = len(lens)
    slopes, turns = slopes.reshape(-1, terms), turns_of(camera, points).reshape(-1, 3)
    slopes = slopes - turns @ np.linalg.lstsq(turns[fitted], slopes[fitted], rcond=None)[0]
    variance = ((slopes @ covariance) * slopes).sum(axis=1).reshape(-1, 2).sum(axis=1)
    return as_map(np.sqrt(variance), has_ray)


def extrapolation(sigmas_px: FloatArray) -> float:
    """Return the projection's largest uncertainty over its median; infinite where pixels have no ray."""
    ratio = float(sigmas_px.max() / np.median(sigmas_px))
    return ratio if np.isfinite(ratio) else np.inf


def sigmas_in_light(
    camera: CameraModel, sigmas_px: FloatArray, light: tuple[FloatArray, float], depth_mm: tuple[float, float]
) -> FloatArray:
    """Return the projection's uncertainty (N,) px where a plane of light is seen, nearest to farthest.

    The plane's points x, normal · x = distance, are seen in a band of the image: what of (7, 9) px borders on it.
    """
    pixels, (normal, distance_mm) = nodes(camera.image_size, _FINE), light
    rays = np.column_stack([camera.undistort(pixels, float(np.mean(depth_mm))), np.ones(len(pixels))])
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = distance_mm / (rays @ normal)
    band = image_coverage(pixels[(depths > depth_mm[0]) & (depths < depth_mm[1])], camera.image_size) > 0
    return sigmas_px.ravel()[touching(band)]


def touching(seen: np.ndarray) -> np.ndarray:
    """Return which corners of cells touch a seen cell, (63,)."""
    wide = np.pad(seen, 1)
    return np.ravel(wide[1:, 1:] | wide[:-1, 1:] | wide[1:, :-1] | wide[:-1, :-1])
