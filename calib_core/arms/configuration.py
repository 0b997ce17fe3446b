"""Joints from a pose by what a controller's file says of how the arm stands."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from calib_core.frames import RigidTransform

if TYPE_CHECKING:  # records know the conventions, which readers of files are asked for
    from calib_core.records import ArmTable

Range = tuple[float, float]
ANYWHERE: tuple[Range, ...] = ((-180.0, 180.0),)
"""Of a joint of which nothing is told."""
_EDGE_DEG = 0.05  # poses are written with three digits
_FARTHEST_DEG = (200.0, 200.0, 300.0, 720.0, 180.0 + _EDGE_DEG, 720.0)


@dataclass(frozen=True)
class Configuration:
    """How a file says that an arm of six joints stands; what it does not say is None, or anywhere.

    Parameters
    ----------
    ranges_deg : tuple
        Of each joint the ranges in one of which it is.
    front, up : bool or None
        As `branches.Branch` has them.
    upright_deg : tuple of float
        Joints, as the brand counts, of the upper arm upright and the forearm to the front.
    """

    ranges_deg: tuple[tuple[Range, ...], ...] = (ANYWHERE,) * 6
    front: bool | None = None
    up: bool | None = None
    upright_deg: tuple[float, ...] = (0.0,) * 6


def joints_by(arm: "ArmTable", pose: RigidTransform, told: Configuration) -> list[tuple[float, ...]]:
    """Return the joints, deg, in which an arm stands in a pose as it is told: one, if the pose is told clearly.

    Raises
    ------
    InputError
        If the arm is not of the kind that `branches.branches_of_pose` knows.
    """
    from calib_core.arms.branches import branches_of_pose

    found: list[tuple[float, ...]] = []
    for branch in branches_of_pose(arm, pose, told.upright_deg):
        if told.front in (None, branch.front) and told.up in (None, branch.up):
            each = zip(branch.joints_deg, told.ranges_deg, _FARTHEST_DEG, strict=True)
            turned = [_turned_into(*one) for one in each]
            found += [tuple(value for value in turned if value is not None)] if None not in turned else []
    return found


def _turned_into(value: float, ranges: Sequence[Range], farthest: float) -> float | None:
    """Return an angle by the fewest whole turns with which it is in one of some ranges; None where it never is."""
    for turns in (0, -1, 1, -2, 2):
        turned = value + 360.0 * turns
        if abs(turned) < farthest and any(low - _EDGE_DEG <= turned <= high + _EDGE_DEG for low, high in ranges):
            return turned
    return None
