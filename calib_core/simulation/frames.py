"""Frames of boards and spheres under room light and a sheet of laser light, traced ray by ray.

The stripe is the sheet's Gaussian profile across, laid over whatever surface each pixel's ray meets first; blur by
lens and pixel widens it and the pattern's edges.  Then come speckle, vignetting, photon and read noise, hot
pixels, saturation and rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import Hit, Surface

FloatArray = NDArray[np.float64]
ImageArray = NDArray[np.uint8 | np.uint16]


@dataclass(frozen=True, eq=False)
class LightSheet:
    """The laser: a plane normal · p = distance of the camera frame, from a source in it.

    Parameters
    ----------
    normal : (3,)
    distance_mm : float
    source_mm : (3,)
        Where the light comes from; what lies behind a surface as seen from there is dark.
    thickness_mm : float
        Standard deviation of the Gaussian profile across.
    brightness : float
        Grey values of a sharp stripe's peak on white.
    """

    normal: FloatArray
    distance_mm: float
    source_mm: FloatArray
    thickness_mm: float = 0.25
    brightness: float = 150.0


@dataclass(frozen=True)
class Exposure:
    """How the sensor turns light into grey values.

    Parameters
    ----------
    ambient : float
        Grey values of white under room light; the board's frame needs some, the stripe's frame may be dark.
    black : float
        Grey value of no light.
    blur_px : float
        Standard deviation of lens and pixel in focus.
    focus_normal, focus_distance_mm
        The plane that is in focus, normal · p = distance; a tilted sensor lets it lie in the sheet of light.
    blur_per_mm : float
        How the blur (px) grows with the distance from the plane in focus.
    speckle : float
        Relative standard deviation of the laser light's brightness from grain to grain.
    vignetting : float
        1: light falls with the fourth power of the cosine to the axis; 0: even.
    read_noise, photon_gain : float
        Standard deviation in the dark, and variance per grey value of light, grey values.
    hot_pixels : int
        Pixels that are bright by themselves.
    bits : 8, 10, 12 or 16
    """

    ambient: float = 0.0
    black: float = 6.0
    blur_px: float = 0.6
    focus_normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    focus_distance_mm: float = 250.0
    blur_per_mm: float = 0.004
    speckle: float = 0.05
    vignetting: float = 1.0
    read_noise: float = 1.0
    photon_gain: float = 0.02
    hot_pixels: int = 0
    bits: Literal[8, 10, 12, 16] = 8


def render(
    camera: SimulatedCamera,
    surfaces: Sequence[Surface],
    sheet: LightSheet | None,
    exposure: Exposure,
    rng: np.random.Generator,
) -> ImageArray:
    """Return the frame (H, W) that the camera takes.

    Parameters
    ----------
    camera : SimulatedCamera
    surfaces : sequence of Surface
        The nearest along each pixel's ray is seen.
    sheet : LightSheet or None
    exposure : Exposure
    rng : numpy random generator
        Of noise and speckle; the hot pixels are the camera's own and stay.
    """
    return sense(light(camera, surfaces, sheet, exposure, rng), exposure, rng)


def light(
    camera: SimulatedCamera,
    surfaces: Sequence[Surface],
    sheet: LightSheet | None,
    exposure: Exposure,
    rng: np.random.Generator,
) -> FloatArray:
    """Return the grey values (H, W) that the light alone would give: no noise, no saturation, no rounding."""
    rays = camera.rays
    depth = np.full(rays.shape[:2], np.inf)
    image = np.zeros(rays.shape[:2])
    grain = _speckle(rays.shape[:2], exposure.speckle, rng) if sheet is not None else None
    for surface in surfaces:
        whole = surface.meet(rays)
        part = _where_finite(whole.depth_mm)
        if part is None:
            continue
        hit = Hit(whole.depth_mm[part], whole.points_mm[part], whole.normals[part])
        near = hit.depth_mm < depth[part]
        blur = _blur_px(hit, exposure)
        white = surface.white(hit, blur)
        seen = exposure.ambient * white
        if sheet is not None and grain is not None:
            stripe = _stripe(hit, sheet, blur)
            seen = seen + white * grain[part] * stripe * _is_lit(hit, stripe > 0, sheet, surfaces)
        depth[part] = np.where(near, hit.depth_mm, depth[part])
        image[part] = np.where(near, seen, image[part])
    cosine = 1.0 / np.linalg.norm(rays, axis=-1)
    return image * (1 - exposure.vignetting * (1 - cosine**4))


def sense(image: FloatArray, exposure: Exposure, rng: np.random.Generator) -> ImageArray:
    """Return the frame (H, W) that the sensor makes of light: noise, hot pixels, saturation, rounding."""
    largest = 2**exposure.bits - 1
    unit = (largest + 1) / 256  # brightness is told in 8-bit grey values
    sigma = np.sqrt(exposure.read_noise**2 + exposure.photon_gain * image)
    grey = (image + exposure.black + sigma * rng.standard_normal(image.shape)) * unit
    own = np.random.default_rng(exposure.hot_pixels)
    rows = own.integers(0, image.shape[0], exposure.hot_pixels)
    columns = own.integers(0, image.shape[1], exposure.hot_pixels)
    grey[rows, columns] += own.uniform(60.0, 250.0, exposure.hot_pixels) * unit
    return np.clip(np.rint(grey), 0, largest).astype(np.uint8 if exposure.bits == 8 else np.uint16)


def _where_finite(depth_mm: FloatArray) -> tuple[slice, slice] | None:
    """Return the rows and columns in which a surface is seen, and two around for slopes; None if it is not."""
    seen = np.isfinite(depth_mm)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    if not rows.size:
        return None
    return (
        slice(max(int(rows[0]) - 2, 0), int(rows[-1]) + 3),
        slice(max(int(columns[0]) - 2, 0), int(columns[-1]) + 3),
    )


def _blur_px(hit: Hit, exposure: Exposure) -> FloatArray:
    away = hit.points_mm @ np.array(exposure.focus_normal) - exposure.focus_distance_mm
    return np.hypot(exposure.blur_px, exposure.blur_per_mm * np.where(np.isfinite(away), away, 0.0))


def _stripe(hit: Hit, sheet: LightSheet, blur_px: FloatArray) -> FloatArray:
    """Return the sheet's light on a surface as the blurred image shows it, grey values on white."""
    height = hit.points_mm @ sheet.normal - sheet.distance_mm
    down, right = np.gradient(height)
    slope = np.hypot(down, right)
    with np.errstate(divide="ignore", invalid="ignore"):
        sharp = sheet.thickness_mm / slope
        width = np.hypot(sharp, blur_px)
        stripe = sheet.brightness * sharp / width * np.exp(-0.5 * (height / slope / width) ** 2)
    return np.where(np.isfinite(stripe), stripe, 0.0)


def _is_lit(
    hit: Hit, asked: NDArray[np.bool_], sheet: LightSheet, surfaces: Sequence[Surface]
) -> NDArray[np.bool_]:
    """Return whether the laser's light reaches the points that are asked for, and from their front."""
    points = hit.points_mm[asked]
    reached = ((sheet.source_mm - points) * hit.normals[asked]).sum(axis=-1) > 0
    for surface in surfaces:
        reached &= ~surface.shades(points, sheet.source_mm)
    lit = np.zeros(asked.shape, dtype=bool)
    lit[asked] = reached
    return lit


def _speckle(shape: tuple[int, ...], contrast: float, rng: np.random.Generator) -> FloatArray:
    """Return relative brightness (H, W) about 1, its grains a pixel or two large."""
    grains = rng.standard_normal((shape[0] + 1, shape[1] + 1))
    mixed = (grains[1:, 1:] + grains[:-1, 1:] + grains[1:, :-1] + grains[:-1, :-1]) / 2
    return np.clip(1.0 + contrast * mixed, 0.0, None)
