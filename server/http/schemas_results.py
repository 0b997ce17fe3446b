"""What the routes of results give: the record of each stage, and what is known beside it."""

from typing import Annotated

from pydantic import BaseModel, Field

from calib_core.exports.workpiece import AtWorkpiece
from calib_core.records import (
    CameraResult,
    ChainResult,
    LaserPlaneResult,
    MergeResult,
    TcpResult,
    TurntableResult,
)


class Stored(BaseModel):
    """What the server says of a result; `stale` where captures or cell have changed since.

    `at_workpiece` is what its uncertainty means there; `turned_deg` how far the flange was turned at each capture,
    from the first one.
    """

    stale: bool
    at_workpiece: list[AtWorkpiece] = Field(default_factory=list[AtWorkpiece])
    turned_deg: dict[str, float] = Field(default_factory=dict)


class StoredCameraResult(CameraResult, Stored):
    """The camera's result as the server keeps it."""


class StoredLaserPlaneResult(LaserPlaneResult, Stored):
    """The result of the plane of light as the server keeps it."""


class StoredTcpResult(TcpResult, Stored):
    """The tool's result as the server keeps it."""


class StoredTurntableResult(TurntableResult, Stored):
    """The turntable's result as the server keeps it."""


class StoredChainResult(ChainResult, Stored):
    """The result of tool and table together as the server keeps it."""


class StoredMergeResult(MergeResult, Stored):
    """The merge's result as the server keeps it."""


StoredResult = Annotated[
    StoredCameraResult
    | StoredLaserPlaneResult
    | StoredTcpResult
    | StoredTurntableResult
    | StoredChainResult
    | StoredMergeResult,
    Field(discriminator="stage"),
]
StageResult = Annotated[
    CameraResult | LaserPlaneResult | TcpResult | TurntableResult | ChainResult | MergeResult,
    Field(discriminator="stage"),
]
