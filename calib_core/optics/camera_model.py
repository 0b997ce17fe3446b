"""The camera: pinhole, lens distortion, tilted sensor, and distortion that changes with depth.

A pixel (0, 0) is the centre of the top-left pixel. The camera frame has x right, y down, z forward.
The coefficients and their order are OpenCV's, so that calibrations go in and out without a change.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.records import KnownCamera

Model = Literal["plain", "rational", "tilted", "segmental"]

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tauX", "tauY")
PLAIN_COUNT = 5
_FARTHEST_RAY = 5.0  # 79° off the axis
TILT = slice(12, 14)


@dataclass(frozen=True, eq=False)
class Segment:
    """One band of depth and the distortion that holds in it.

    Parameters
    ----------
    near_mm, far_mm : float
        The band's ends, depth z in the camera frame; neighbours overlap.
    distortion : (14,)
    """

    near_mm: float
    far_mm: float
    distortion: FloatArray


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A calibrated camera.

    Parameters
    ----------
    camera_matrix : (3, 3)
        px.
    distortion : (14,)
        k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tauX tauY, the last two in rad; segmental: the middle band's.
    model : {"plain", "rational", "tilted", "segmental"}
    image_size : (width, height)
    segments : tuple of Segment
        Bands from near to far, neighbours overlapping; empty unless segmental.
    inverse_depth_of_laser : (3,) or None
        q with 1 / depth = q · (x, y, 1) on the plane of light, 1/mm: see `with_laser_plane`.

    Raises
    ------
    InputError
        If the numbers cannot be a camera.
    """

    camera_matrix: FloatArray
    distortion: FloatArray = field(default_factory=lambda: np.zeros(14))
    model: Model = "plain"
    image_size: tuple[int, int] = (0, 0)
    segments: tuple[Segment, ...] = ()
    inverse_depth_of_laser: FloatArray | None = None

    def __post_init__(self) -> None:
        matrix = np.array(self.camera_matrix, dtype=float)
        distortion = _full_distortion(self.distortion)
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            need = "a camera matrix of 3×3 numbers with positive focal lengths"
            to_do = "Give fx 0 cx / 0 fy cy / 0 0 1 in pixels."
            raise InputError(need, str(np.array2string(matrix, precision=4)).replace("\n", ""), to_do)
        if (self.model == "segmental") != (len(self.segments) > 1):
            need = "at least two bands of depth for a segmental camera, and none for another"
            to_do = "Give the segments that the calibration found."
            raise InputError(
                need, "model '{model}' with {count} bands", to_do, model=self.model, count=len(self.segments)
            )
        object.__setattr__(self, "camera_matrix", matrix)
        object.__setattr__(self, "distortion", distortion)

    @classmethod
    def from_names(
        cls, camera_matrix: ArrayLike, distortion: Mapping[str, float], image_size: tuple[int, int] = (0, 0)
    ) -> "CameraModel":
        """Return a camera from coefficients by name (`COEFFICIENTS`); those left out are zero.

        Raises
        ------
        InputError
            If a name is unknown.
        """
        unknown = sorted(set(distortion) - set(COEFFICIENTS))
        if unknown:
            to_do = message("Use OpenCV's names; the tilts are tauX and tauY in rad.")
            raise InputError.unknown(", ".join(unknown), COEFFICIENTS, "distortion", to_do)
        d = np.array([float(distortion.get(name, 0.0)) for name in COEFFICIENTS])
        return cls(np.asarray(camera_matrix, dtype=float), d, _simplest_model(d), image_size)

    @classmethod
    def from_known(cls, known: KnownCamera) -> "CameraModel":
        """Return the camera that a user brought as `cell.known.camera`."""
        plain = cls.from_names(known.camera_matrix, known.distortion, known.image_size or (0, 0))
        if not known.segments:
            return plain
        segments = tuple(
            Segment(band.near_mm, band.far_mm, cls.from_names(known.camera_matrix, band.distortion).distortion)
            for band in known.segments
        )
        return replace(plain, model="segmental", segments=segments)

    @property
    def distortion_by_name(self) -> dict[str, float]:
        """The coefficients by name, as far as the model uses them."""
        return name_distortion(self.distortion)

    @property
    def is_plain(self) -> bool:
        """Whether k1 k2 p1 p2 k3 and a tilt, which is a homography, say all: what the fast kernel needs."""
        return not self.segments and not np.any(self.distortion[PLAIN_COUNT:12])

    @cached_property
    def pixels_from_rays(self) -> FloatArray:
        """Camera matrix times the tilt's homography, (3, 3): distorted rays to pixels."""
        from calib_core.kernels.project import tilt_homography

        return self.camera_matrix @ tilt_homography(*self.distortion[TILT])

    @cached_property
    def rays_from_pixels(self) -> FloatArray:
        """The inverse of `pixels_from_rays`, (3, 3): pixels to distorted rays."""
        return np.asarray(np.linalg.inv(self.pixels_from_rays), dtype=np.float64)

    @cached_property
    def bands(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distortion per band (B, 14) and the bands' near and far ends (B,), mm; one band unless segmental."""
        if not self.segments:
            return self.distortion[None], np.array([-np.inf]), np.array([np.inf])
        return (
            np.array([s.distortion for s in self.segments]),
            np.array([s.near_mm for s in self.segments], dtype=float),
            np.array([s.far_mm for s in self.segments], dtype=float),
        )

    @cached_property
    def fold(self) -> float:
        """How far from the axis a ray (x, y, 1) may be: where the radial polynomial turns back; else infinite.

        Infinite too where no pixel of the image comes near: what lies beyond is then of no concern.
        """
        r = np.linspace(0.0, _FARTHEST_RAY, 4001)
        s = r**2
        nearest, seen = np.inf, _image_reach(self)
        for d in self.bands[0]:
            under = 1.0 + s * (d[5] + s * (d[6] + s * d[7]))
            with np.errstate(divide="ignore", invalid="ignore"):
                distorted = r * (1.0 + s * (d[0] + s * (d[1] + s * d[4]))) / under
            turns = np.flatnonzero(~(np.diff(distorted) > 0) | (under[1:] <= 0))
            if len(turns) and distorted[turns[0]] < seen:
                nearest = min(nearest, float(r[turns[0]]))
        return nearest

    def within_fold(self, rays: FloatArray) -> FloatArray:
        """Return rays (N, 2), NaN for those beyond the fold: every way from pixels to rays ends at this gate."""
        if np.isfinite(self.fold):
            rays[~(np.hypot(rays[:, 0], rays[:, 1]) <= self.fold)] = np.nan
        return rays

    def with_laser_plane(self, normal: ArrayLike, distance_mm: float) -> "CameraModel":
        """Return the camera with the plane of light, normal · p = distance in the camera frame.

        A segmental camera needs it: along the plane, a pixel's place on the sensor gives its depth and band.
        """
        q = np.asarray(normal, dtype=float) / distance_mm
        return replace(self, inverse_depth_of_laser=q)

    def project(self, points_in_camera_mm: ArrayLike) -> FloatArray:
        """Return the pixels (N, 2) of points (N, 3) of the camera frame, mm; NaN behind the camera."""
        from calib_core.kernels.project import project_points

        points = np.ascontiguousarray(points_in_camera_mm, dtype=float).reshape(-1, 3)
        return project_points(points, self.pixels_from_rays, *self.bands)

    def undistort(self, pixels: ArrayLike, depth_mm: ArrayLike | None = None) -> FloatArray:
        """Return the rays (x, y, 1) of pixels, as (N, 2): the exact inverse of `project`, by Newton's iteration.

        NaN where a pixel has no ray: beyond the fold of the distortion.

        Parameters
        ----------
        pixels : (N, 2)
        depth_mm : float or (N,), optional
            Depth of what is seen; only a segmental camera asks for it, and only where it knows no plane of light.

        Raises
        ------
        InputError
            If the camera is segmental and neither depth nor plane of light is known.
        """
        from calib_core.kernels.project import undistort_over_depth
        from calib_core.kernels.undistort import undistort_pixels

        p = np.ascontiguousarray(pixels, dtype=float).reshape(-1, 2)
        if not self.segments:
            return self.within_fold(undistort_pixels(p, self.rays_from_pixels, self.distortion, self.is_plain))
        q = np.zeros((len(p), 3))
        if depth_mm is not None:
            q[:, 2] = 1.0 / np.asarray(depth_mm, dtype=float)
        elif self.inverse_depth_of_laser is not None:
            q[:] = self.inverse_depth_of_laser
        else:
            need = "the plane of light, or a depth, for a camera whose distortion changes with depth"
            raise InputError(need, "neither", "Calibrate the laser plane first.")
        return self.within_fold(undistort_over_depth(p, self.rays_from_pixels, *self.bands, q))


def _image_reach(camera: CameraModel) -> float:
    """Return how far from the axis the image's corners lie as distorted rays, with a margin; else infinite."""
    width, height = camera.image_size
    if not width or not height:
        return np.inf
    corners = np.array([[u, v, 1.0] for u in (-0.5, width - 0.5) for v in (-0.5, height - 0.5)])
    distorted = corners @ camera.rays_from_pixels.T
    return 1.05 * float(np.hypot(*(distorted[:, :2] / distorted[:, 2:]).T).max())


def name_distortion(distortion: FloatArray) -> dict[str, float]:
    """Return coefficients (14,) by name: k1 k2 p1 p2 k3 always, the others where they are not zero."""
    return {
        name: float(value)
        for i, (name, value) in enumerate(zip(COEFFICIENTS, distortion, strict=True))
        if i < PLAIN_COUNT or value != 0
    }


def _full_distortion(distortion: ArrayLike) -> FloatArray:
    given = np.asarray(distortion, dtype=float).ravel()
    if given.size > 14 or not np.isfinite(given).all():
        raise InputError(
            "up to 14 finite distortion coefficients",
            message("{count} of them", count=given.size) if given.size > 14 else "NaN or infinity",
            "Give them in OpenCV's order: {coefficients}.",
            coefficients=" ".join(COEFFICIENTS),
        )
    return np.concatenate([given, np.zeros(14 - given.size)])


def _simplest_model(distortion: FloatArray) -> Model:
    if np.any(distortion[TILT]):
        return "tilted"
    return "rational" if np.any(distortion[PLAIN_COUNT:12]) else "plain"
