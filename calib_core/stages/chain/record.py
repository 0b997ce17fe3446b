"""The result of the whole chain."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Matrix4, Rows, Vector3
from calib_core.records.results import (
    ArmErrorsFound,
    AtPoint,
    OpticsShift,
    Result,
    ScannerFound,
    Undetermined,
    VarianceComponents,
)
from calib_core.stages.tcp.record import TcpResidual, TwoStep
from calib_core.stages.turntable.record import TableFields, TurntableResidual


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
    scanner: ScannerFound | None = None
    optics: list[OpticsShift] = Field(default_factory=list[OpticsShift])
    workpiece: AtPoint | None = None
    arm_errors: ArmErrorsFound | None = None
    confidence_95: dict[str, float] = Field(default_factory=dict)
    residuals: list[TcpResidual | TurntableResidual]
