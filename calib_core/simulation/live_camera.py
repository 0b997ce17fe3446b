"""The raw camera of the simulated cell as it lives: the stripe on the sphere as an image, made fast."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.simulation.motion import FloatArray

WIDTH_PX, HEIGHT_PX = 1280, 1024
USUAL_EXPOSURE_US = 5000.0
_FOCAL_PX = 2500.0
_CENTER_PX = (639.5, 511.5)
_BESIDE_MM = 120.0  # the camera's centre from the plane of light
_AIM_MM = 190.0  # where its axis meets that plane, in L
_STRIPE_PX = 1.8
_PATCH = np.arange(-8, 9)
_BRIGHTNESS = 180.0
_DARK, _NOISE = 8.0, 2.0
_BACKGROUNDS = 4
_LONGEST_GAP_PX = 8.0


class LiveCamera:
    """A pinhole beside the plane of light that looks along the stripe's columns.

    Its frame L is that of the rule for planes of light: the origin is the foot of the camera's centre, z lies
    under its axis.  So the cell's profiles are told in the frame in which its images are triangulated.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        axis = np.array([0.0, _BESIDE_MM, _AIM_MM]) / np.hypot(_BESIDE_MM, _AIM_MM)
        x = np.array([1.0, 0.0, 0.0])
        self._laser_from_camera = np.column_stack([x, np.cross(axis, x), axis])
        noise = rng.normal(_DARK, _NOISE, (_BACKGROUNDS, HEIGHT_PX, WIDTH_PX))
        self._dark = np.clip(np.round(noise), 0, 255).astype(np.uint8)

    def known(self) -> dict[str, Any]:
        """Return camera and plane of light as `cell.known` writes them."""
        normal = self._laser_from_camera[1]
        (cx, cy), f = _CENTER_PX, _FOCAL_PX
        return {
            "camera": {"camera_matrix": [[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]], "distortion": {}},
            "laser_plane": {"normal": normal.tolist(), "distance_mm": _BESIDE_MM},
        }

    def image(
        self, points_mm: FloatArray, rng: np.random.Generator, exposure_us: float = USUAL_EXPOSURE_US
    ) -> NDArray[np.uint8]:
        """Return the image (H, W), 8 bit, of a stripe through points (N, 3) of L, ordered by x."""
        image = np.roll(self._dark[rng.integers(_BACKGROUNDS)], int(rng.integers(HEIGHT_PX)), axis=0)
        columns, rows = self._stripe(points_mm)
        if not len(columns):
            return image
        lit = np.round(rows).astype(int) + _PATCH[:, None]
        light = np.exp(-0.5 * ((lit - rows) / _STRIPE_PX) ** 2) * _BRIGHTNESS * exposure_us / USUAL_EXPOSURE_US
        value = light + rng.normal(_DARK, _NOISE, lit.shape)
        image[lit, columns] = np.clip(np.round(value), 0, 255).astype(np.uint8)
        return image

    def _stripe(self, points_mm: FloatArray) -> tuple[NDArray[np.int_], FloatArray]:
        """Return the columns that the stripe crosses and the row in each; none where the points have a hole."""
        in_camera = (points_mm + np.array([0.0, _BESIDE_MM, 0.0])) @ self._laser_from_camera
        pixels = _FOCAL_PX * in_camera[:, :2] / in_camera[:, 2:] + _CENTER_PX
        if len(pixels) < 2:
            return np.empty(0, dtype=int), np.empty(0)
        u, v = pixels.T
        columns = np.arange(max(int(np.ceil(u[0])), 0), min(int(u[-1]) + 1, WIDTH_PX))
        next_one = np.clip(np.searchsorted(u, columns), 1, len(u) - 1)
        rows = np.interp(columns, u, v)
        seen = (u[next_one] - u[next_one - 1] < _LONGEST_GAP_PX) & (rows > 9) & (rows < HEIGHT_PX - 10)
        return columns[seen], rows[seen]
