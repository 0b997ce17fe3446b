"""The result of the board's hand-eye calibration."""

from typing import Any, Literal

from pydantic import Field

from calib_core.frames import RigidTransform
from calib_core.records.base import Matrix4, Record, Rows
from calib_core.records.results import CaptureResidual, Result


class HandEyeResidual(CaptureResidual):
    """How far one frame saw the board from where the robot's pose puts it: in degrees, mm, and sigmas of six."""

    angle_deg: float | None = None
    shift_mm: float | None = None
    mahalanobis: float | None = None


class Agreement(Record):
    """How far the scanner on the flange by the board lies from the sphere's.

    `sigmas` are the six differences (rx ry rz tx ty tz, board less sphere) in units of both uncertainties,
    `distance` is the Mahalanobis distance of all six, `chance` how often an equal or larger one happens where both
    are right. Both rest on one camera and one plane of light, whose errors are in both: they agree better than
    two that share nothing. `with_stage` is the stage whose answer it is, or "known".
    """

    with_stage: str
    angle_deg: float
    shift_mm: float
    sigmas: list[float]
    distance: float
    degrees_of_freedom: int = 6
    chance: float


class HandEyeResult(Result):
    """The camera on the flange and the board in the base, from frames of a fixed board; or the other way round.

    `covariance` is of the camera's pose, `board_covariance` of the board's. `tool0_from_laser_by_board` or
    `base_from_laser_by_board` is the scanner that follows with the plane of light, `laser_covariance` its own;
    null where there is none.
    `pitch_factor` is the board's pitch by the robot's lengths over the told one.
    """

    stage: Literal["hand-eye"] = "hand-eye"
    tool0_from_camera: Matrix4 | None = None
    base_from_camera: Matrix4 | None = None
    covariance: Rows
    base_from_board: Matrix4 | None = None
    tool0_from_board: Matrix4 | None = None
    board_covariance: Rows
    pitch_factor: float = 1.0
    pitch_sigma: float | None = None
    position_sigma_mm: float
    orientation_sigma_deg: float
    tool0_from_laser_by_board: Matrix4 | None = None
    base_from_laser_by_board: Matrix4 | None = None
    laser_covariance: Rows | None = None
    agreement: Agreement | None = None
    residuals: list[HandEyeResidual] = Field(default_factory=list[HandEyeResidual])

    @property
    def scanner_by_board(self) -> Matrix4 | None:
        """The scanner that follows with the plane of light."""
        return self.tool0_from_laser_by_board or self.base_from_laser_by_board

    @property
    def camera_on_mount(self) -> Matrix4:
        """The camera's pose on what carries it."""
        found = self.tool0_from_camera or self.base_from_camera
        assert found is not None
        return found


def by_name(*found: RigidTransform) -> dict[str, Any]:
    """Return poses by the names of their fields."""
    return {f"{one.into}_from_{one.outof}": one.to_rows() for one in found}


def by_board(tool: RigidTransform | None) -> dict[str, Any]:
    """Return the scanner that follows with the plane of light by the name of its field."""
    return {} if tool is None else {f"{tool.into}_from_laser_by_board": tool.to_rows()}
