"""The result of the camera stage."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Finite, Matrix4, Record, Rows
from calib_core.records.results import CaptureResidual, Result
from calib_core.records.session import CameraSegment


class CameraResidual(CaptureResidual):
    """Figures of one view of the board; `points_px` and `residuals_px` (seen minus predicted) draw its arrows."""

    corners: int = 0
    rms_px: float | None = None
    edge_width_px: float | None = None
    camera_from_board: Matrix4 | None = None
    points_px: Rows = Field(default_factory=list)
    residuals_px: Rows = Field(default_factory=list)


class CameraCandidate(Record):
    """A camera model that was compared, with a flat board or a `bent` one, and its error on held-out views."""

    model: str
    parameters: int
    held_out_rms_px: float
    bent: bool = False


class CameraCoverage(Record):
    """Where the boards were seen: corners per cell (rows from the top), their depths, the largest tilt.

    `projection_sigma_px` is how far a ray may end from its pixel at the corners of the cells, None where a pixel
    has no ray.
    """

    counts: list[list[int]]
    covered: float
    near_mm: float
    far_mm: float
    largest_tilt_rad: float
    projection_sigma_px: list[list[Finite | None]] = Field(default_factory=list[list[Finite | None]])


class SolvedBoardShape(Record):
    """How a board leaves its plane: mm of x², xy, y², x³, x²y, xy², y³, places scaled to ±1 about its middle.

    `extent_mm` are the lowest and the highest x and y of its points.
    """

    coefficients_mm: list[float]
    extent_mm: Rows


class CameraByRobot(Record):
    """What the robot's poses say of the camera, where it was carried past a fixed board.

    `pitch_factor` is the board's pitch by the robot's lengths over the told one; `focal_px` (fx, fy) is by boards
    and robot together; `chance` is how often noise alone moves the camera so far from the one by the boards.
    """

    views: int
    pitch_factor: float
    pitch_sigma: float
    focal_px: list[float]
    focal_sigma_px: list[float]
    chance: float
    position_sigma_mm: float
    orientation_sigma_deg: float


class CameraResult(Result):
    """The camera, with its evidence; `covariance` is of `parameters`, in their order and units (px, rad, 1).

    `tilt_rad` are the sensor's two angles, also in `distortion` as tauX and tauY. `inflation` is by how much the
    covariance has grown for errors that a view's corners share.
    """

    stage: Literal["camera"] = "camera"
    model: Literal["plain", "rational", "tilted", "segmental"]
    image_size: tuple[int, int]
    camera_matrix: Rows
    distortion: dict[str, float]
    tilt_rad: list[float]
    segments: list[CameraSegment] = Field(default_factory=list)
    reprojection_rms_px: float
    corner_sigma_px: float
    parameters: list[str]
    covariance: Rows
    inflation: float = 1.0
    tilt_correlation: float | None = None
    board_bend_mm: float | None = None
    board_shape: SolvedBoardShape | None = None
    candidates: list[CameraCandidate] = Field(default_factory=list)
    coverage: CameraCoverage
    by_robot: CameraByRobot | None = None
    residuals: list[CameraResidual]
