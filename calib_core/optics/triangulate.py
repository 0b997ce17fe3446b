"""Pixels of the stripe to points of L: undistort, cut the ray with the plane of light."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError, MeasurementError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane import camera_from_laser_of, oriented_plane
from calib_core.optics.stripe import StripeCenters, StripeOptions, find_stripe

_STEP_PX = 0.01


@dataclass(frozen=True, eq=False)
class ProfileCalibration:
    """All it takes to make a profile of a frame: the camera and the plane of light in it.

    Parameters
    ----------
    camera : CameraModel
    normal : (3,)
        Unit normal of the plane of light in the camera frame.
    distance_mm : float
        normal · p = distance on the plane.
    camera_from_laser : RigidTransform, optional
        The frame L; left out, it follows the rule of `laser_plane.camera_from_laser_of`.

    Raises
    ------
    InputError
        If the plane runs through the camera's centre, or L's y axis is not the plane's normal.
    """

    camera: CameraModel
    normal: FloatArray
    distance_mm: float
    camera_from_laser: RigidTransform

    @classmethod
    def of(
        cls,
        camera: CameraModel,
        normal: ArrayLike,
        distance_mm: float,
        camera_from_laser: RigidTransform | None = None,
    ) -> "ProfileCalibration":
        """Return the calibration of a camera and a plane normal · p = distance."""
        n, d = oriented_plane(normal, distance_mm)
        frame = camera_from_laser or camera_from_laser_of(n, d)
        y_axis, origin = frame.rotation[:, 1], frame.translation_mm
        if abs(abs(float(y_axis @ n)) - 1) > 1e-6 or abs(float(n @ origin) - d) > 1e-3:
            need = "a camera_from_laser whose y axis is the plane's normal and whose origin lies in the plane"
            to_do = "Leave camera_from_laser out; it follows from the plane."
            raise InputError(need, "one that is off the plane", to_do)
        return cls(camera.with_laser_plane(n, d) if camera.segments else camera, n, d, frame)

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of its numbers: what else makes a profile of a frame."""
        camera, frame = self.camera, self.camera_from_laser
        bands = [part for band in camera.segments for part in ((band.near_mm, band.far_mm), band.distortion)]
        numbers = (camera.camera_matrix, camera.distortion, camera.image_size, self.normal, self.distance_mm)
        digest = hashlib.sha256()
        for part in (*numbers, frame.rotation, frame.translation_mm, *bands):
            digest.update(np.asarray(part, dtype=float).tobytes())
        return digest.hexdigest()

    @cached_property
    def _axes(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        rotation, origin = self.camera_from_laser.rotation, self.camera_from_laser.translation_mm
        x, z = np.ascontiguousarray(rotation[:, 0]), np.ascontiguousarray(rotation[:, 2])
        return self.normal / self.distance_mm, x, z, np.array([x @ origin, z @ origin])

    @cached_property
    def _points_of(self) -> Callable[[FloatArray], FloatArray]:
        from calib_core.kernels.triangulate import triangulate_pixels

        camera = self.camera
        constants = np.concatenate([camera.rays_from_pixels.ravel(), camera.distortion, *self._axes])
        return partial(triangulate_pixels, camera.is_plain, constants)

    def points(self, pixels: ArrayLike) -> FloatArray:
        """Return the points (N, 3) of L, mm, of pixels (N, 2); NaN where a pixel has no ray or meets no plane."""
        p = np.ascontiguousarray(pixels, dtype=float).reshape(-1, 2)
        if not self.camera.segments:
            points = self._points_of(p)
            if np.isfinite(self.camera.fold):
                points[np.isnan(self.camera.undistort(p)[:, 0])] = np.nan
            return points
        plane, x_axis, z_axis, offsets = self._axes
        rays = np.column_stack([self.camera.undistort(p), np.ones(len(p))])
        on_plane = rays / (rays @ plane)[:, None]
        return np.column_stack([on_plane @ x_axis - offsets[0], np.zeros(len(p)), on_plane @ z_axis - offsets[1]])


@dataclass(frozen=True, eq=False)
class Triangulated:
    """Points of L with what the stripe centres' own errors do to them.

    Parameters
    ----------
    points_in_laser_mm : (N, 3)
        y is 0.
    covariance : (N, 2, 2)
        Of (x, z), mm²; of rank one, as a centre's error has one direction.
    without_ray : int
        Centres that were dropped because they have no ray: they lie beyond the fold of the distortion.
    """

    points_in_laser_mm: FloatArray
    covariance: FloatArray
    without_ray: int = 0

    @property
    def profile_mm(self) -> FloatArray:
        """The points as (N, 2): x, z."""
        return self.points_in_laser_mm[:, [0, 2]]


def triangulate(
    calibration: ProfileCalibration, pixels: ArrayLike, sigma_px: ArrayLike = 0.0, across: ArrayLike = (0.0, 1.0)
) -> Triangulated:
    """Return the points of L that pixels of the stripe show, with their covariance.

    Parameters
    ----------
    calibration : ProfileCalibration
    pixels : (N, 2)
        Column and row.
    sigma_px : float or (N,)
        Standard deviation of each centre.
    across : (2,)
        The direction, in column and row, in which the centres err.
    """
    p = np.ascontiguousarray(pixels, dtype=float).reshape(-1, 2)
    step = _STEP_PX * np.asarray(across, dtype=float)
    points = calibration.points(p)
    slope = (calibration.points(p + step) - calibration.points(p - step))[:, [0, 2]] / (2 * _STEP_PX)
    error = slope * np.broadcast_to(np.asarray(sigma_px, dtype=float), len(p))[:, None]
    return Triangulated(points, error[:, :, None] * error[:, None, :])


def triangulate_stripe(calibration: ProfileCalibration, stripe: StripeCenters) -> Triangulated:
    """Return the points of L of a stripe's centres, sorted by x; only those in front of the camera."""
    found = triangulate(calibration, stripe.pixels, stripe.sigma_px, stripe.across)
    points = found.points_in_laser_mm
    in_camera = calibration.camera_from_laser.apply(points)
    order = np.argsort(points[:, 0], kind="stable")
    order = order[np.isfinite(points[order, 0]) & (in_camera[order, 2] > 0)]
    return Triangulated(points[order], found.covariance[order], int(np.isnan(points[:, 0]).sum()))


def stripe_in_frame(
    image: NDArray[np.uint8 | np.uint16], calibration: ProfileCalibration, options: StripeOptions | None = None
) -> Triangulated:
    """Return the points of L that a frame of the stripe shows, and how many of its centres have no ray.

    Parameters
    ----------
    image : (H, W) or (H, W, 3), 8 or 16 bit
    calibration : ProfileCalibration
    options : StripeOptions, optional

    Raises
    ------
    InputError
        If the frame's size is not that of the calibrated camera.
    MeasurementError
        If no stripe is seen, or none of it can lie on the plane of light.
    """
    width, height = calibration.camera.image_size
    if width and (image.shape[1], image.shape[0]) != (width, height):
        raise InputError(
            "a frame of {width}×{height} pixels, as the camera was calibrated with",
            message("{width}×{height} pixels", width=image.shape[1], height=image.shape[0]),
            "Record with the same camera settings, without cropping or binning.",
            width=width,
            height=height,
        )
    found = triangulate_stripe(calibration, find_stripe(image, options))
    if not len(found.points_in_laser_mm):
        raise MeasurementError(
            "a stripe on the plane of light",
            message(
                "a line that cannot lie on it, {count} of its centres beyond the fold of the distortion",
                count=found.without_ray,
            )
            if found.without_ray
            else "a line that cannot lie on it",
            "Check that the plane was calibrated with this camera and laser.",
        )
    return found
