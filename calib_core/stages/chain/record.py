"""The result of the whole chain."""

from typing import Literal

from calib_core.records.base import OpenRows
from calib_core.stages.tcp.record import TcpResidual, ToolResult
from calib_core.stages.turntable.record import TableFields, TurntableResidual


class ChainResult(ToolResult, TableFields):
    """Tool and turntable from all captures together; the stages' own answers stay beside it.

    `covariance` is of the scanner, `turntable_covariance` of base_from_turntable, `cross_covariance` (6, 6)
    of the two.
    """

    stage: Literal["chain"] = "chain"
    turntable_covariance: OpenRows
    cross_covariance: OpenRows
    residuals: list[TcpResidual | TurntableResidual]
