"""What sources of robots have in common: poses from joints by an arm, the active tool, and how fast to ask."""

import time
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose
from server.sources.source import Settings

Host = Annotated[str, Field(min_length=1, max_length=255)]
Port = Annotated[int, Field(ge=1, le=65535)]
Interval = Annotated[float, Field(ge=0.002, le=1.0)]


class ToolAndFrame(Settings):
    """For controllers that tell their active tool in their active frame, where these are not flange and base.

    `tool` is tool0_from_tool and `frame` base_from_frame, as the brand writes a pose; empty is the flange, and the
    base.  A named `arm` gives the flange by the joints instead.
    """

    tool: list[float] = Field(default=[], max_length=16)
    frame: list[float] = Field(default=[], max_length=16)
    arm: str | None = Field(default=None, max_length=64, description="A named arm: the flange by its joints.")


def flange_of(settings: ToolAndFrame, convention: str, pose: RigidTransform) -> RigidTransform:
    """Return base_from_tool0 of a pose that is told of the active tool in the active frame; raises InputError."""
    if not settings.tool and not settings.frame:
        return pose
    matrix = pose.matrix
    if settings.frame:
        matrix = parse_pose(convention, settings.frame, "frame").matrix @ matrix
    if settings.tool:
        matrix = matrix @ parse_pose(convention, settings.tool, "tool").inverse().matrix
    return RigidTransform.from_rounded(matrix.tolist(), "base", "tool0")


def flange_by_joints(arm: str, joints_deg: Sequence[float]) -> RigidTransform:
    """Return base_from_tool0 of a named arm; raises InputError."""
    return flange_of_joints(arm_of(arm), joints_deg)


def axis_number(axis: str | None, values: Sequence[float]) -> float | None:
    """Return the value of an external axis `E1` … `E6`, None where none is named; raises InputError."""
    if axis is None:
        return None
    place = int(axis[1:]) - 1
    if place >= len(values):
        need = "the external axis {axis}"
        to_do = "Name another."
        raise InputError(need, "{count} external axes", to_do, "table_axis", axis=axis, count=len(values))
    return values[place]


class Pace:
    """Waits so that a device is asked no more often than once in an interval."""

    def __init__(self, interval_s: float) -> None:
        self._interval_s, self._next_s = interval_s, 0.0

    def wait(self) -> None:
        """Return when it is time to ask again."""
        time.sleep(max(0.0, self._next_s - time.monotonic()))
        self._next_s = time.monotonic() + self._interval_s
