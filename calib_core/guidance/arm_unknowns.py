"""The arm's own errors among what captures tell: which candidates it reaches, and how it errs in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.arms.errors import ArmTerm, arm_moves, arm_terms
from calib_core.arms.inverse import joints_of_poses
from calib_core.arms.kinematics import arm_of
from calib_core.captures.content import pose_of
from calib_core.chain.arm_model import ArmInput, arm_columns
from calib_core.chain.chain_data import ChainData
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations
from calib_core.frames import FloatArray
from calib_core.guidance.candidates import Candidates
from calib_core.records import ArmTable, Capture, Cell

_SIX = 6
_ALIKE_DEG = 2.0  # joints as read, and those of the pose: an arm whose errors are in its controller


@dataclass(frozen=True, eq=False)
class ArmUnknowns:
    """An arm whose errors are solved with the tool.

    Attributes
    ----------
    table : ArmTable
        Of six turning joints.
    terms : tuple of ArmTerm
    near_deg : (6,)
        Joints in the configuration of the captures.
    """

    table: ArmTable
    terms: tuple[ArmTerm, ...]
    near_deg: FloatArray

    @property
    def sigmas(self) -> FloatArray:
        """What is believed of each term, (p,)."""
        return np.array([term.sigma for term in self.terms])

    def reached(self, poses: Candidates) -> Candidates:
        """Return those poses that the arm reaches in this configuration, with how its flange moves in them."""
        if not len(poses):
            return poses
        rotations, translations = poses.arrays
        joints, good = _joints(self.table, rotations, translations, self.near_deg)
        moves = _moves(self.table, joints[good], len(self.terms))
        return replace(poses.chosen(np.flatnonzero(good)), arm_moves=moves)

    def columns(self, data: ChainData, state: ChainState, observations: Observations) -> FloatArray:
        """Return how the ball of each observation moves in L by one standard deviation of each term, (K, 3, p)."""
        none = np.zeros((6, len(self.terms)))
        moves = np.array([none if one.arm_moves is None else one.arm_moves for one in observations])
        found = arm_columns(
            data, state, ArmInput(self.terms, moves.reshape(-1, *none.shape)), np.arange(data.count)
        )
        return found * self.sigmas


def arm_unknowns(cell: Cell, captures: Sequence[Capture], result: Mapping[str, Any] | None) -> ArmUnknowns | None:
    """Return an arm whose errors are worth to be told, None where joints are not known or it is not to be solved.

    A result that found the arm's errors not to be worth it leaves them out.
    """
    found = (result or {}).get("arm_model")
    if cell.robot.arm is None or cell.robot.errors == "cover" or (found and not found["worth_it"]):
        return None
    table = arm_of(cell.robot.arm)
    near = _near(cell, table, captures)
    return None if near is None else ArmUnknowns(table, arm_terms(table), near)


def with_joints(captures: Sequence[Capture]) -> list[Capture]:
    """Return captures that have a reading of each of six turning joints."""
    return [one for one in captures if len(one.joints_deg or []) == _SIX and None not in (one.joints_deg or [])]


def _near(cell: Cell, table: ArmTable, captures: Sequence[Capture]) -> FloatArray | None:
    """Return the newest capture's joints (6,), deg; None without any, or where one's are not those of its pose."""
    told = with_joints(captures)
    if not told or len(table.joints) != _SIX or any(joint.kind != "revolute" for joint in table.joints):
        return None
    joints = np.array([one.joints_deg for one in told], dtype=float)
    poses = Candidates(tuple(pose_of(cell, one) for one in told), np.zeros((len(told), 3)))
    by_pose, reached = joints_of_poses(table, *poses.arrays, joints)
    agree = reached & (np.abs(by_pose - joints).max(axis=1) < _ALIKE_DEG)
    return joints[-1] if agree.all() else None


def _joints(
    table: ArmTable, rotations: FloatArray, translations: FloatArray, near_deg: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return joints (K, 6), deg, and which poses are reached within the joints' limits, (K,)."""
    joints, good = joints_of_poses(table, rotations, translations, np.tile(near_deg, (len(rotations), 1)))
    limits = np.array([joint.limits or (-np.inf, np.inf) for joint in table.joints])
    return joints, good & np.all((joints >= limits[:, 0]) & (joints <= limits[:, 1]), axis=1)


def _moves(table: ArmTable, joints_deg: FloatArray, many: int) -> FloatArray:
    return arm_moves(table, joints_deg.tolist()) if len(joints_deg) else np.zeros((0, 6, many))
