"""What every result has, and the result of the TCP."""

from importlib import import_module
from typing import Final, Literal

from pydantic import Field

from calib_core.records.base import Matrix4, Record, Rows, Vector3, Verdict
from calib_core.records.evidence import AnyBlock

_SHOWN: Final = "calib_core.stages.evidence"  # by name: the records know nothing of what shows them


class CaptureResidual(Record):
    """What one capture contributed to a solve, or why it did not."""

    capture: str
    used: bool
    reason: str | None = None


class TcpResidual(CaptureResidual):
    """Figures of one capture of the sphere, in millimetres unless the name says otherwise.

    A sweep is one row: the root mean squares over those of its `profiles` that are used, and their mean offset.
    """

    points: int = 0
    surface_rms_mm: float | None = None
    center_distance_mm: float | None = None
    center_offset_in_base_mm: list[float] | None = None
    leave_one_out_rms_mm: float | None = None
    two_step_surface_rms_mm: float | None = None
    mahalanobis: float | None = None
    side: int | None = None
    zone: float | None = None
    profiles: int | None = None
    profiles_used: int | None = None


class Result(Record):
    """What every stage's result has, beside the name of its `stage`.

    `warnings` are doubts, one sentence a cause; `notes` say what else is worth knowing; `evidence` is the result
    told in blocks, as terminal, report and page show it.
    """

    method: str
    software: str
    inputs_sha256: str
    verdict: Verdict
    warnings: list[str] = Field(default_factory=list)
    notes: list[str] = Field(default_factory=list)
    evidence: list[AnyBlock] = Field(default_factory=list[AnyBlock])

    def __str__(self) -> str:
        return import_module(_SHOWN).text_of(self)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.verdict}; print it, or show it in a notebook>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return import_module(_SHOWN).html_of(self)


class VarianceComponents(Record):
    """Standard deviations of the point noise and of the robot's random pose errors."""

    point_sigma_mm: float | None
    position_sigma_mm: float
    orientation_sigma_rad: float
    orientation_sigma_deg: float
    estimated: list[str] = Field(default_factory=list)


class Undetermined(Record):
    """A direction of the answer that the motions do not fix."""

    direction: list[float]
    description: str


class TwoStep(Record):
    """The paper's two-step answer, beside the joint one."""

    tool0_from_laser: Matrix4 | None = None
    sphere_center_in_base_mm: Vector3 | None = None
    surface_rms_mm: float | None = None
    leave_one_out_surface_rms_mm: float | None = None
    center_scatter_rms_mm: float | None = None
    covariance: Rows | None = None
    translations: list[list[str]] = Field(default_factory=list)
    reason: str | None = None


class TcpResult(Result):
    """The scanner's pose on the flange, with its evidence."""

    stage: Literal["tcp"] = "tcp"
    tool0_from_laser: Matrix4
    covariance: Rows
    sphere_center_in_base_mm: Vector3
    sphere_center_covariance: Rows
    surface_rms_mm: float
    leave_one_out_surface_rms_mm: float | None
    center_scatter_rms_mm: float
    undetermined: list[Undetermined] = Field(default_factory=list)
    two_step: TwoStep
    variance_components: VarianceComponents
    confidence_95: dict[str, float] = Field(default_factory=dict)
    residuals: list[TcpResidual]
