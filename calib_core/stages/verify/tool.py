"""The tool that is verified."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calib_core.cell.found import as_used
from calib_core.frames import FloatArray, RigidTransform
from calib_core.stages.tcp.record import ToolResult


@dataclass(frozen=True, eq=False)
class Tool:
    """The tool that is verified.

    Parameters
    ----------
    mount_from_laser : RigidTransform
    covariance : (6, 6)
        Rotation perturbing on the right, rad and mm; zeros where it is taken as exact.
    position_sigma_mm, orientation_sigma_rad : float
        Of the robot's poses.
    axis_moves : mapping
        By captures, how one sigma of each error of the cell's axes turns and shifts the robot (6, n), rad and mm,
        as seen from what carries the ball.
    """

    mount_from_laser: RigidTransform
    covariance: FloatArray
    position_sigma_mm: float = 0.0
    orientation_sigma_rad: float = 0.0
    axis_moves: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])

    @classmethod
    def of(cls, answer: ToolResult) -> "Tool":
        """Return the tool of a stage's answer."""
        parts = answer.variance_components
        return cls(
            answer.mount_from_laser,
            np.array(as_used(answer.model_dump())["covariance"], dtype=float),
            parts.position_sigma_mm,
            parts.orientation_sigma_rad,
        )
