"""The result of the laser-plane stage."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Matrix4, Record, Rows, Vector3
from calib_core.records.results import CaptureResidual, Result
from calib_core.records.session import CameraSegment


class RefinedCamera(Record):
    """The camera as it was refined together with the plane of light: the one that belongs to that plane."""

    model: Literal["plain", "rational", "tilted", "segmental"]
    image_size: tuple[int, int]
    camera_matrix: Rows
    distortion: dict[str, float]
    segments: list[CameraSegment] = Field(default_factory=list)


class PlaneInCamera(Record):
    """The plane of light in the camera frame: normal · p = distance, distance not negative."""

    normal: Vector3
    distance_mm: float


class LaserPlaneResidual(CaptureResidual):
    """Figures of one board with the stripe: its points on the plane of light, and its corners."""

    points: int = 0
    line_rms_mm: float | None = None
    line_mean_mm: float | None = None
    stripe_sigma_px: float | None = None
    board_sigma_px: float | None = None
    board_distance_mm: float | None = None


class LaserPlaneResult(Result):
    """The plane of light in the camera frame, and the frame L in it.

    `covariance` is of camera_from_laser, `plane_covariance` (4, 4) of the normal and the distance,
    `joint_covariance` of the camera's parameters named (none where the camera was brought) and normal / distance.
    `camera` is the camera refined together with the plane, where the session's boards gave it.
    """

    stage: Literal["laser-plane"] = "laser-plane"
    plane_in_camera: PlaneInCamera
    camera_from_laser: Matrix4
    plane_rms_mm: float
    covariance: Rows
    plane_covariance: Rows
    camera: RefinedCamera | None = None
    joint_parameters: list[str] = Field(default_factory=list)
    joint_covariance: Rows
    normal_sigma_deg: float
    distance_sigma_mm: float
    residuals: list[LaserPlaneResidual]
