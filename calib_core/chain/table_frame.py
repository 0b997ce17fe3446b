"""The frame T of a turntable: its rule, and how uncertain it is.

z is the axis, in the sense that points up in base (along base's +z; where the axis is within 12° of level, in the
sense that the cell's `direction` gives, else that in which the angles count up).  The origin is the centre of the
first mounting's circle, or of its sphere at zero where the axis is linear.  x is base's x axis without its part
along z (base's y where those two nearly coincide).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib_core.cell.layout import AXIS_UNKNOWNS, SCALE_COLUMN
from calib_core.chain.table import TableState
from calib_core.frames import FloatArray, RigidTransform

LEVEL = float(np.sin(np.deg2rad(12.0)))
"""An axis whose z is less is level: which of its ends points up does not tell them apart."""

_STEP_RAD, _STEP_MM = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class TableFrame:
    """A turntable by the rule: point_in_base = base_from_turntable · Rz(direction · scale · angle) · s_m.

    Attributes
    ----------
    base_from_turntable : RigidTransform
    direction : {1, -1}
        Whether the angles count right-handed about z.
    mounts_mm : (M, 3)
        The sphere's centre in T at angle zero, one row a mounting.
    """

    base_from_turntable: RigidTransform
    direction: int
    mounts_mm: FloatArray

    @property
    def axis(self) -> FloatArray:
        """The axis's direction in base, (3,)."""
        return self.base_from_turntable.rotation[:, 2]


@dataclass(frozen=True, eq=False)
class TableCovariance:
    """Covariances of a `TableFrame`.

    Attributes
    ----------
    pose : (6, 6)
        rx ry rz tx ty tz of base_from_turntable, rad and mm.
    axis_direction, axis_point : (3, 3)
        Of the axis's unit vector and of T's origin, in base.
    mounts : (3 M, 3 M)
    pose_by_unknowns : (6, size)
        The derivative of the pose by the table's unknowns.
    """

    pose: FloatArray
    axis_direction: FloatArray
    axis_point: FloatArray
    mounts: FloatArray
    pose_by_unknowns: FloatArray

    @property
    def axis_direction_sigma_rad(self) -> float:
        """The standard deviation of the angle between the true axis and the stated one (root of both tilts')."""
        return float(np.sqrt(np.trace(self.axis_direction)))


def frame_by_rule(state: TableState, given_direction: int | None = None, upward: bool | None = None) -> TableFrame:
    """Return a table's state as the frame T.

    Parameters
    ----------
    state : TableState
    given_direction : {1, -1}, optional
        The cell's: it decides the sense of an axis that is nearly level.
    upward : bool, optional
        Keep (True) or turn round (False) the state's own z, instead of deciding.
    """
    axis = state.rotation[:, 2]
    if upward is None:
        upward = bool(axis[2] > 0) if abs(axis[2]) > LEVEL else (given_direction or 1) > 0
    sign = 1.0 if upward else -1.0
    origin = state.mounts[0] if state.shifts else state.origin + axis * state.mounts[0, 2]
    z = sign * axis
    across = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = across - z * (z @ across)
    x = x / np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(z, x), z])
    mounts = (state.mounts_in_base - origin) @ rotation
    return TableFrame(RigidTransform.of(rotation, origin, "base", "turntable"), int(sign), mounts)


def frame_covariance(
    state: TableState, covariance: FloatArray, given_direction: int | None = None
) -> TableCovariance:
    """Return how uncertain the frame is, from the covariance (size, size) of the table's unknowns."""
    frame = frame_by_rule(state, given_direction)
    pose = pose_by_unknowns(state, given_direction)
    axis = _derivative(state, frame, lambda other: other.axis)
    mounts = _derivative(state, frame, lambda other: other.mounts_mm.ravel())
    return TableCovariance(
        pose=pose @ covariance @ pose.T,
        axis_direction=axis @ covariance @ axis.T,
        axis_point=pose[3:] @ covariance @ pose[3:].T,
        mounts=mounts @ covariance @ mounts.T,
        pose_by_unknowns=pose,
    )


def pose_by_unknowns(state: TableState, given_direction: int | None = None) -> FloatArray:
    """Return how base_from_turntable follows the table's unknowns, (6, size)."""
    frame = frame_by_rule(state, given_direction)
    return _derivative(state, frame, lambda other: frame.base_from_turntable.difference(other.base_from_turntable))


def _derivative(state: TableState, frame: TableFrame, of: Callable[[TableFrame], FloatArray]) -> FloatArray:
    upward = frame.direction > 0
    steps = np.full(AXIS_UNKNOWNS + state.mounts.size, _STEP_MM)
    steps[:2] = steps[SCALE_COLUMN] = _STEP_RAD
    columns: list[FloatArray] = []
    for k, step in enumerate(steps):
        change = np.zeros(len(steps))
        change[k] = step
        ahead = of(frame_by_rule(state.moved(change), upward=upward))
        behind = of(frame_by_rule(state.moved(-change), upward=upward))
        columns.append((ahead - behind) / (2 * step))
    return np.stack(columns, axis=1)
