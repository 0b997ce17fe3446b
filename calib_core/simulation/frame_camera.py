"""The simulated camera: its own forward model of lens and sensor, which shares no code with the solvers.

Pixel (0, 0) is the middle of the top-left pixel; the camera frame has x right, y down, z forward.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SimulatedCamera:
    """A pinhole with distortion and, if wanted, a tilted sensor; numbers mean what OpenCV's model means by them.

    Parameters
    ----------
    width, height : int
        px.
    focal_px : (fx, fy)
    center_px : (cx, cy)
    radial : up to six numbers
        k1 k2 k3 of the numerator and k4 k5 k6 of the denominator.
    tangential : (p1, p2)
    tilt_rad : (about x, about y)
        The sensor's tilt.
    """

    width: int = 640
    height: int = 480
    focal_px: tuple[float, float] = (900.0, 902.0)
    center_px: tuple[float, float] = (318.0, 243.0)
    radial: tuple[float, ...] = (-0.12, 0.08, 0.0)
    tangential: tuple[float, float] = (0.0004, -0.0003)
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    _scratch: dict[str, FloatArray] = field(default_factory=dict, repr=False)

    @cached_property
    def sensor(self) -> FloatArray:
        """Distorted rays to pixels, (3, 3): tilt, then focal lengths and centre."""
        a, b = self.tilt_rad
        about_x = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
        about_y = np.array([[np.cos(b), 0, -np.sin(b)], [0, 1, 0], [np.sin(b), 0, np.cos(b)]])
        r = about_y @ about_x
        onto = np.array([[r[2, 2], 0, -r[0, 2]], [0, r[2, 2], -r[1, 2]], [0, 0, 1.0]])
        (fx, fy), (cx, cy) = self.focal_px, self.center_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]) @ onto @ r

    def distorted(self, rays: FloatArray) -> FloatArray:
        """Return where the lens puts rays (..., 2) = (x/z, y/z)."""
        k = [*self.radial, *([0.0] * (6 - len(self.radial)))]
        p1, p2 = self.tangential
        x, y = rays[..., 0], rays[..., 1]
        s = x * x + y * y
        ratio = (1 + k[0] * s + k[1] * s**2 + k[2] * s**3) / (1 + k[3] * s + k[4] * s**2 + k[5] * s**3)
        return np.stack(
            [x * ratio + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * ratio + p1 * (s + 2 * y * y) + 2 * p2 * x * y],
            axis=-1,
        )

    def pixels(self, points_in_camera_mm: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of points (N, 3) of the camera frame, mm."""
        bent = self.distorted(points_in_camera_mm[:, :2] / points_in_camera_mm[:, 2:])
        homogeneous = np.column_stack([bent, np.ones(len(bent))]) @ self.sensor.T
        return homogeneous[:, :2] / homogeneous[:, 2:]

    @property
    def rays(self) -> FloatArray:
        """The ray (x, y, 1) of every pixel, (H, W, 3)."""
        if "rays" not in self._scratch:
            v, u = np.mgrid[0 : self.height, 0 : self.width].astype(float)
            target = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(self.sensor).T
            bent = target[..., :2] / target[..., 2:]
            self._scratch["rays"] = np.concatenate([self._straight(bent), np.ones((*u.shape, 1))], axis=-1)
        return self._scratch["rays"]

    def _straight(self, bent: FloatArray) -> FloatArray:
        """Return the rays whose `distorted` is `bent`: secant steps with a difference quotient along each axis."""
        rays = bent.copy()
        h = 1e-6
        right, down = np.array([h, 0.0]), np.array([0.0, h])
        for _ in range(25):
            error = self.distorted(rays) - bent
            if np.abs(error).max() < 1e-13:
                break
            dx = (self.distorted(rays + right) - self.distorted(rays - right)) / (2 * h)
            dy = (self.distorted(rays + down) - self.distorted(rays - down)) / (2 * h)
            determinant = dx[..., 0] * dy[..., 1] - dx[..., 1] * dy[..., 0]
            rays[..., 0] -= (error[..., 0] * dy[..., 1] - error[..., 1] * dy[..., 0]) / determinant
            rays[..., 1] -= (error[..., 1] * dx[..., 0] - error[..., 0] * dx[..., 1]) / determinant
        return rays
