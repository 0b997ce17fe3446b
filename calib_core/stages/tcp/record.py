"""The result of the tcp stage."""

from typing import Literal

from pydantic import Field

from calib_core.cell.found import ScannerPlaced
from calib_core.records.base import OpenRows, Record, Rows, Vector3
from calib_core.records.results import (
    ArmErrorsFound,
    ArmModelFound,
    AtPoint,
    CaptureResidual,
    OpticsShift,
    Result,
    ScannerFound,
    Undetermined,
    VarianceComponents,
)
from calib_core.records.topology import TopologyFields


class TcpResidual(CaptureResidual):
    """Figures of one capture of the sphere, in millimetres unless the name says otherwise.

    `weight` is below 1 where a capture lies off: its pose counts so much less.  A sweep is one
    row: the root mean squares over those of its `profiles` that are used, and their mean offset.
    Excluding the capture would move a point at the workpiece by `shift_without_mm`, turn the scanner
    by `turn_without_deg` and make that point's uncertainty `growth_without` times as large: one step
    from the answer, before anything is solved again.  A sweep has these of none of its profiles.
    """

    points: int = 0
    surface_rms_mm: float | None = None
    center_distance_mm: float | None = None
    center_offset_in_base_mm: list[float] | None = None
    center_offset_in_tool0_mm: list[float] | None = None
    leave_one_out_rms_mm: float | None = None
    two_step_surface_rms_mm: float | None = None
    mahalanobis: float | None = None
    weight: float | None = None
    side: int | None = None
    zone: float | None = None
    shift_without_mm: float | None = None
    turn_without_deg: float | None = None
    growth_without: float | None = None
    profiles: int | None = None
    profiles_used: int | None = None


class SessionDriftPoint(Record):
    """One used capture: how far it lies along the drift, and what the drift says; `at_s` from the first."""

    capture: str
    at_s: float | None
    offset_mm: float
    sigma_mm: float
    course_mm: float


class SessionDrift(Record):
    """How far scanner or sphere drifted from the first used capture to the last, ± `uncertainty_mm` (k = 2).

    It is `found` where chance does not explain it, and had `settled` where it came to rest before the end; then
    `again` names the captures that were taken before. `over_s` and `settling_s`, its time constant, are null where
    the captures have no `device_time_s`: then their order counts.
    """

    moved: Literal["scanner", "sphere", "scanner-or-sphere"]
    drift_mm: float
    uncertainty_mm: float
    found: bool
    settled: bool
    over_s: float | None = None
    settling_s: float | None = None
    again: list[str] = Field(default_factory=list[str])
    sentence: str = ""
    points: list[SessionDriftPoint] = Field(default_factory=list[SessionDriftPoint])


class TwoStep(ScannerPlaced):
    """The paper's two-step answer, beside the joint one."""

    sphere_center_in_base_mm: Vector3 | None = None
    sphere_center_in_tool0_mm: Vector3 | None = None
    surface_rms_mm: float | None = None
    leave_one_out_surface_rms_mm: float | None = None
    center_scatter_rms_mm: float | None = None
    covariance: Rows | None = None
    translations: list[list[str]] = Field(default_factory=list)
    reason: str | None = None


class ToolResult(Result, ScannerPlaced, TopologyFields):
    """What tells of the scanner's pose on what carries it, solved alone or together with the table.

    The sphere of a scanner on the flange stands in base, that of one that stands still is on the flange.  Where
    the cell names its scanners, the pose is that of the first that was solved, `scanner` its name, and
    `scanner_errors` has what was found of each; `frames` has all.
    """

    covariance: OpenRows
    sphere_center_in_base_mm: Vector3 | None = None
    sphere_center_in_tool0_mm: Vector3 | None = None
    sphere_center_covariance: OpenRows
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] = Field(default_factory=list)
    two_step: TwoStep
    variance_components: VarianceComponents
    scanner: ScannerFound | str | None = None
    scanner_errors: dict[str, ScannerFound] | None = None
    optics: list[OpticsShift] = Field(default_factory=list[OpticsShift])
    workpiece: AtPoint | None = None
    arm_errors: ArmErrorsFound | None = None
    arm_model: ArmModelFound | None = None
    confidence_95: dict[str, float] = Field(default_factory=dict)

    @property
    def sphere_center_mm(self) -> list[float]:
        """The sphere's centre in what carries it."""
        return self.sphere_center_in_base_mm or self.sphere_center_in_tool0_mm or []

    @property
    def errors_of_scanner(self) -> ScannerFound | None:
        """What was found of the one scanner, or of the first."""
        if isinstance(self.scanner, str):
            return (self.scanner_errors or {}).get(self.scanner)
        return self.scanner


class TcpResult(ToolResult):
    """The scanner's pose on the flange, with its evidence."""

    stage: Literal["tcp"] = "tcp"
    warm_up: SessionDrift | None = None
    residuals: list[TcpResidual]
