"""The result of the turntable stage."""

from typing import Literal

from pydantic import Field

from calib_core.cell.found import ScannerPlaced
from calib_core.records.base import Open, OpenMatrix4, OpenRows, OpenVector3, Record, Vector3
from calib_core.records.results import CaptureResidual, Result, Undetermined, VarianceComponents
from calib_core.records.topology import TopologyFields


class TurntableResidual(CaptureResidual):
    """Measured minus expected sphere centre of one capture of the table: across, around and along its axis.

    `table_deg` is the angle as read, `angle_deg` the part around the axis as an angle of the table.
    """

    mount: str | None = None
    table_deg: float | None = None
    points: int = 0
    surface_rms_mm: float | None = None
    center_distance_mm: float | None = None
    radial_mm: float | None = None
    tangential_mm: float | None = None
    axial_mm: float | None = None
    angle_deg: float | None = None
    center_in_base_mm: list[float] | None = None
    mahalanobis: float | None = None
    side: int | None = None
    profiles: int | None = None
    profiles_used: int | None = None


class TableCircle(Record):
    """The circle of one mounting by the paper's method, in base; the RMS in its plane and out of it."""

    mount: str
    center_in_base_mm: Vector3
    normal_in_base: Vector3
    radius_mm: float
    circle_rms_mm: float
    plane_rms_mm: float
    captures: list[str]


class TableMount(Record):
    """Where one mounting put the sphere's centre, in the turntable's frame at angle zero."""

    mount: str
    center_in_turntable_mm: Vector3
    radius_mm: float
    captures: int


class EncoderScaleError(Record):
    """The table turns by 1 + error for each unit read; `applied` where the answer accounts for it."""

    error: float
    sigma: float
    applied: bool


class TableFields(Record):
    """The turntable's axis and frame T: z the axis, the origin the centre of the first mounting's circle.

    point_in_base = base_from_turntable · Rz(direction · table angle) · point_in_turntable.  `covariance` of
    base_from_turntable has rank 5, since T's x axis follows from z; `axis_direction_sigma_deg` is the standard
    deviation of the angle between true and stated axis.  A linear axis errs in its readings by `reading_sigma_mm`;
    its `angle_sigma_deg` and `angle_rms_deg` are 0, and its captures have no angles.
    """

    base_from_turntable: OpenMatrix4
    axis_direction_in_base: OpenVector3
    axis_point_in_base_mm: OpenVector3
    direction: Literal[1, -1]
    axis_direction_covariance: OpenRows
    axis_point_covariance: OpenRows
    axis_direction_sigma_deg: Open
    axis_point_sigma_mm: Open
    mounts: list[TableMount]
    circles: list[TableCircle] = Field(default_factory=list)
    circles_axis_direction_in_base: Vector3 | None = None
    angle_sigma_deg: float
    reading_sigma_mm: float | None = None
    encoder_scale: EncoderScaleError
    radial_rms_mm: float
    axial_rms_mm: float
    angle_rms_deg: float


class TurntableResult(Result, TableFields, ScannerPlaced, TopologyFields):
    """The turntable, with its evidence; the scanner's pose that it rests on is on the flange or in base."""

    stage: Literal["turntable"] = "turntable"
    covariance: OpenRows
    undetermined: list[Undetermined] = Field(default_factory=list)
    variance_components: VarianceComponents
    residuals: list[TurntableResidual]
