"""How much worse a camera's projection is known where no board was seen."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from calib_core.frames import FloatArray
from calib_core.optics.adjust import Adjustment
from calib_core.optics.camera_layout import Layout, camera_of
from calib_core.optics.coverage_cells import CELLS

if TYPE_CHECKING:
    from calib_core.optics.camera_solution import Fit

_RADIAL = (4, 5, 8)  # k1, k2 and k3 in the vector of shared parameters
_USUAL = (1.0, 3.0, 5.0)  # lenses have k2 and k3 of so many times k1² and k1³
_LEAST = 0.02  # of k1: a lens that seems to have none
_SMALL_TURN_RAD = 1e-5
_STEP = 0.01  # of a standard deviation


def extrapolation(fit: "Fit", layout: Layout, image_size: tuple[int, int], seen: np.ndarray) -> float:
    """Return the projection's largest uncertainty in the image over its median; infinite where pixels have no ray.

    A term of the lens that the boards do not ask for is zero, which holds for what they saw: beyond, it may be
    what is usual for lenses. A turn of the whole camera is no error of it: the one that fits the `seen` cells
    (6, 8) best is taken off.
    """
    lens = layout.free if len(layout.nears) > 1 else np.union1d(layout.free, _RADIAL)
    whole, shared = replace(layout, free=lens), fit.adjusted.state.shared
    known = Adjustment(fit.corners, *layout.bands, lens).equations(fit.adjusted.state).hessian
    scale = (fit.sigma_px * float(fit.corners.weights.max())) ** 2
    for term, (place, factor) in enumerate(zip(_RADIAL, _USUAL, strict=True), start=1):
        if place not in layout.free and place in lens:
            at = int(np.searchsorted(lens, place))
            known[at, at] += scale / (factor * max(abs(shared[_RADIAL[0]]), _LEAST) ** term) ** 2
    covariance = np.linalg.inv(known)
    camera, pixels = camera_of(shared, layout, image_size), _nodes(image_size)
    depth_mm = float(np.median(fit.adjusted.state.translations[:, 2]))
    points = np.column_stack([camera.undistort(pixels, depth_mm), np.ones(len(pixels))]) * depth_mm
    if not np.isfinite(points).all():
        return np.inf

    def projected(place: int, step: float) -> FloatArray:
        moved = shared.copy()
        moved[place] += step
        return camera_of(moved, whole, image_size).project(points)

    steps = _STEP * np.sqrt(np.diag(covariance))
    slopes = np.stack(
        [(projected(i, s) - projected(i, -s)) / (2 * s) for i, s in zip(lens, steps, strict=True)], axis=-1
    )
    turned = [camera.project(points + np.cross(axis, points)) for axis in _SMALL_TURN_RAD * np.eye(3)]
    turns = np.stack([(one - pixels) / _SMALL_TURN_RAD for one in turned], axis=-1)
    fitted = np.repeat(_touching(seen), 2)
    terms = len(lens)
    slopes, turns = slopes.reshape(-1, terms), turns.reshape(-1, 3)
    slopes = slopes - turns @ np.linalg.lstsq(turns[fitted], slopes[fitted], rcond=None)[0]
    variance = ((slopes @ covariance) * slopes).sum(axis=1).reshape(-1, 2).sum(axis=1)
    ratio = float(np.sqrt(variance.max() / np.median(variance)))
    return ratio if np.isfinite(ratio) else np.inf


def _nodes(image_size: tuple[int, int]) -> FloatArray:
    """Return the corners of the cells, the image's border with them, (63, 2) px."""
    axes = [np.linspace(-0.5, length - 0.5, count + 1) for length, count in zip(image_size, CELLS, strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)


def _touching(seen: np.ndarray) -> np.ndarray:
    """Return which corners of cells touch a seen cell, (63,)."""
    wide = np.pad(seen, 1)
    return np.ravel(wide[1:, 1:] | wide[:-1, 1:] | wide[1:, :-1] | wide[:-1, :-1])
