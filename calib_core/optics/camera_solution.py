"""A calibrated camera with its evidence, and the fit that it comes from."""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import Value
from calib_core.optics.adjust import Adjusted, Corners
from calib_core.optics.board_shape import BoardShape
from calib_core.optics.camera_choice import Candidate
from calib_core.optics.camera_model import CameraModel

Misfits = dict[int, dict[str, Value]]
"""Views that are left out, by index, with how far they are off: the values of the finding `view-not-used`."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """Where the boards were seen.

    Attributes
    ----------
    counts : (6, 8)
        Corners in each cell of the image, rows from the top.
    depth_mm : (near, far)
        Of all corners.
    covered : float
        Share of the cells with a corner.
    largest_tilt_rad : float
        Between a board and the image plane.
    extrapolation : float
        The projection's largest uncertainty in the image over its median.
    projection_sigma_px : (7, 9)
        Its uncertainty at the corners of the cells; NaN where a pixel has no ray.
    """

    counts: np.ndarray
    depth_mm: tuple[float, float]
    covered: float
    largest_tilt_rad: float
    extrapolation: float
    projection_sigma_px: np.ndarray


@dataclass(frozen=True, eq=False)
class RobotLengths:
    """What the robot's poses say of a camera.

    Attributes
    ----------
    views : int
    pitch_factor, pitch_sigma : float
        The board's pitch by the robot's lengths, over the told one.
    change : (C,)
        Of the camera's parameters, by boards and robot together, from those by the boards alone.
    sigmas : (C,)
        Of the parameters by both together.
    chance : float
        How often noise alone changes them so much.
    disagreement : (C, C)
        What that adds to the covariance by the boards alone.
    position_sigma_mm, orientation_sigma_rad : float
        How far the robot's poses are off, as the boards show it.
    """

    views: int
    pitch_factor: float
    pitch_sigma: float
    change: FloatArray
    sigmas: FloatArray
    chance: float
    disagreement: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float


@dataclass(frozen=True, eq=False)
class PitchRatio:
    """What square pixels say of a board's pitches.

    Attributes
    ----------
    ratio, sigma : float
        The pitch along a column over that along a row, both over the told ones.
    focal_ratio : float
        fx / fy with the pitches as told.
    change : (C,)
        Of the camera's free parameters with that ratio.
    """

    ratio: float
    sigma: float
    focal_ratio: float
    change: FloatArray


@dataclass(frozen=True, eq=False)
class CameraSolution:
    """A calibrated camera with its evidence.

    Attributes
    ----------
    camera : CameraModel
    parameters : tuple of str
        What the rows of `covariance` stand for.
    covariance : (C, C)
        Scaled by the residuals, and by `inflation`.
    camera_from_board : tuple of RigidTransform or None
        One a view; None where the view was rejected.
    pose_covariances : dict
        View index to (6, 6), order rx ry rz tx ty tz.
    reprojection_rms_px : float
        Of the corners' 2-D distances, over used views.
    corner_sigma_px : float
        Standard deviation of one coordinate, from the residuals.
    view_rms_px : (V,)
        NaN where the view was never fitted.
    residuals_px : tuple of (N, 2)
        Seen minus predicted, one array a view.
    rejected : dict
        View index to how far it is off, the values of `view-not-used`.
    rejected_corners : int
        Corners left out in used views.
    candidates : tuple of Candidate
        Held-out errors of the models that were compared.
    tilt_correlation : float or None
        Largest |correlation| between a tilt and the principal point.
    board_shape : BoardShape or None
        Deviation from the plane, if it was refined.
    bend_mm, bend_gain : float or None
        How far from its plane the board seems to be bent, highest to lowest point, and by what share the residuals
        shrink if it may be; None where there are too few views to tell, or only a slight bend is allowed for.
    inflation : float
        By how much the covariance has grown for errors that a view's corners share; 1 for independent ones.
    coverage : Coverage
    converged : bool
    pitch : PitchRatio or None
        What square pixels say of the board's two pitches, where they contradict the told ones; the covariance
        holds the difference.
    robot : RobotLengths or None
        What the robot's poses say of it, where it was carried past a fixed board; the covariance holds their
        disagreement.
    """

    camera: CameraModel
    parameters: tuple[str, ...]
    covariance: FloatArray
    camera_from_board: tuple[RigidTransform | None, ...]
    pose_covariances: dict[int, FloatArray]
    reprojection_rms_px: float
    corner_sigma_px: float
    view_rms_px: FloatArray
    residuals_px: tuple[FloatArray, ...]
    rejected: Misfits
    rejected_corners: int
    candidates: tuple[Candidate, ...]
    tilt_correlation: float | None
    board_shape: BoardShape | None
    bend_mm: float | None
    bend_gain: float | None
    inflation: float
    coverage: Coverage
    converged: bool
    pitch: PitchRatio | None = None
    robot: RobotLengths | None = None


@dataclass(frozen=True, eq=False)
class Fit:
    """An adjustment of the views that remained: which, why others did not, and the corners with their weights."""

    all_corners: Corners
    corners: Corners
    adjusted: Adjusted
    used: list[int]
    rejected: Misfits
    view_rms_px: FloatArray
    sigma_px: float
