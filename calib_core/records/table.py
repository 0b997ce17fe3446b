"""Results of the turntable, the whole chain and the merge."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Matrix4, Record, Rows, Vector3
from calib_core.records.results import (
    CaptureResidual,
    Result,
    TcpResidual,
    TwoStep,
    Undetermined,
    VarianceComponents,
)


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
    deviation of the angle between true and stated axis.
    """

    base_from_turntable: Matrix4
    axis_direction_in_base: Vector3
    axis_point_in_base_mm: Vector3
    direction: Literal[1, -1]
    axis_direction_covariance: Rows
    axis_point_covariance: Rows
    axis_direction_sigma_deg: float
    axis_point_sigma_mm: float
    mounts: list[TableMount]
    circles: list[TableCircle] = Field(default_factory=list)
    circles_axis_direction_in_base: Vector3 | None = None
    angle_sigma_deg: float
    encoder_scale: EncoderScaleError
    radial_rms_mm: float
    axial_rms_mm: float
    angle_rms_deg: float


class TurntableResult(Result, TableFields):
    """The turntable, with its evidence."""

    stage: Literal["turntable"] = "turntable"
    covariance: Rows
    tool0_from_laser: Matrix4
    undetermined: list[Undetermined] = Field(default_factory=list)
    variance_components: VarianceComponents
    residuals: list[TurntableResidual]


class ChainResult(Result, TableFields):
    """Tool and turntable from all captures together; the stages' own answers stay beside it.

    `covariance` is of tool0_from_laser, `turntable_covariance` of base_from_turntable, `cross_covariance` (6, 6)
    of the two.
    """

    stage: Literal["chain"] = "chain"
    tool0_from_laser: Matrix4
    covariance: Rows
    turntable_covariance: Rows
    cross_covariance: Rows
    sphere_center_in_base_mm: Vector3
    sphere_center_covariance: Rows
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] = Field(default_factory=list)
    two_step: TwoStep
    variance_components: VarianceComponents
    confidence_95: dict[str, float] = Field(default_factory=dict)
    residuals: list[TcpResidual | TurntableResidual]


class MergeResidual(CaptureResidual):
    """Figures of one scan: points kept and dropped by reason, and how it lies to the scans that overlap it.

    `overlap_mean_mm` is how far the scan lies in front of the others, `shift_mm` and `turn_deg` what registration
    did to it.
    """

    points: int = 0
    kept: int = 0
    stray: int = 0
    mixed: int = 0
    grazing: int = 0
    overlap_pairs: int = 0
    overlap_mean_mm: float | None = None
    overlap_rms_mm: float | None = None
    expected_overlap_rms_mm: float | None = None
    shift_mm: float | None = None
    turn_deg: float | None = None


class SharedShift(Record):
    """What the scans' overlap adds to the calibration that they share.

    `shift` is that of tool0_from_laser, then of base_from_turntable: rx ry rz tx ty tz each, rotation perturbing
    on the right, rad and mm; `covariance` (12, 12) is theirs after it.  `directions` counts those that the overlap
    determines 4.5 times better than the captures did; no other is moved.
    """

    directions: int
    shift: list[float]
    covariance: list[list[float]]


class MergeResult(Result):
    """All scans in one frame, and how far they lie apart where they overlap, before any registration.

    `cloud` and `mesh` name the files, where they were stored; `frame` says whether points are in the turntable's
    frame or, without a turntable, in the robot's base.  `expected_overlap_rms_mm` follows from noise and from what
    the calibration leaves uncertain; `registered_overlap_rms_mm` is that after a registration, and
    `registration_shift_rms_mm` how far it moved the scans.  `surface_sigma_mm` is the standard deviation of the
    merged surface's place along its normal.  `spills` counts how often memory was emptied to disk; `calibrated_by`
    says where tool and table come from: the stage, or "known".
    """

    stage: Literal["merge"] = "merge"
    frame: Literal["turntable", "base"]
    cloud: str | None
    points: int
    scanned_points: int
    voxel_mm: float
    spills: int = 0
    overlap_rms_mm: float | None
    expected_overlap_rms_mm: float | None
    overlap_pairs: int
    registered_overlap_rms_mm: float | None = None
    registration_shift_rms_mm: float | None = None
    self_calibration: SharedShift | None = None
    surface_sigma_mm: float | None = None
    calibrated_by: Literal["known", "tcp", "turntable", "chain"] | None = None
    tool0_from_laser: Matrix4 | None = None
    base_from_turntable: Matrix4 | None = None
    mesh: str | None
    triangles: int = 0
    low_mm: Vector3
    high_mm: Vector3
    residuals: list[MergeResidual]

    @property
    def scan_names(self) -> tuple[str, ...]:
        """The scans that were merged, as the cloud's column `scan` counts them: by their first captures."""
        return tuple(row.capture for row in self.residuals if row.used and row.points)
