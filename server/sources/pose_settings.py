"""What sources of robots have in common: poses from joints by an arm, and how fast to ask."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.frames import RigidTransform

Host = Annotated[str, Field(min_length=1, max_length=255)]
Port = Annotated[int, Field(ge=1, le=65535)]
Interval = Annotated[float, Field(ge=0.002, le=1.0)]


def flange_by_joints(arm: str, joints_deg: Sequence[float]) -> RigidTransform:
    """Return base_from_tool0 of a named arm; raises InputError."""
    return flange_of_joints(arm_of(arm), joints_deg)
