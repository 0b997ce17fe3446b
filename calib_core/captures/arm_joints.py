"""What captures' joints tell of the arm: how each flange moves with its errors, and poses corrected by them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib_core.arms.errors import ArmTerm, arm_moves, arm_terms, corrected_pose, joint_readings
from calib_core.arms.kinematics import arm_of
from calib_core.captures.content import pose_of
from calib_core.chain.observations import Observations, SphereObservation
from calib_core.frames import FloatArray, RigidTransform
from calib_core.poses.numbers import to_pose
from calib_core.records import Capture, Cell
from calib_core.records.results import ArmModelFound


def terms_of(cell: Cell) -> tuple[ArmTerm, ...]:
    """Return the terms of the cell's arm; none where it is not known."""
    return () if cell.robot.arm is None else arm_terms(arm_of(cell.robot.arm))


def with_arm_moves(cell: Cell, captures: Sequence[Capture], observations: Observations) -> list[SphereObservation]:
    """Return observations with how their flange moves by the arm's errors, where joints are known."""
    each = {capture.id: moves for capture in captures if (moves := moves_of(cell, capture)) is not None}
    return [replace(one, arm_moves=each.get(one.capture)) for one in observations]


def moves_of(cell: Cell, capture: Capture) -> FloatArray | None:
    """Return how a capture's flange moves with each term, (6, p); None without an arm or its joints."""
    if cell.robot.arm is None or capture.kind == "sweep" or not (capture.joints_deg or capture.joints_mm):
        return None
    arm = arm_of(cell.robot.arm)
    joints = joint_readings(arm, capture.joints_deg or [], capture.joints_mm or [])
    return np.ascontiguousarray(arm_moves(arm, [joints])[0])


def corrected_by(cell: Cell, found: ArmModelFound, pose: RigidTransform, moves: FloatArray) -> RigidTransform:
    """Return a pose as it truly is by an arm's errors, with how it moves with each of the arm's terms (6, p)."""
    names = [term.name for term in terms_of(cell)]
    some = [names.index(name) for name in found.names]
    moved = corrected_pose(pose.rotation, pose.translation_mm, moves[:, some], np.array(found.values))
    return RigidTransform.of(*moved, "base", "tool0")


def applied_moves(cell: Cell, capture: Capture, found: ArmModelFound | None) -> FloatArray | None:
    """Return how a capture's flange moves with the terms that correct its pose, (6, p); None where none do."""
    moves = moves_of(cell, capture) if found is not None and found.applied else None
    if moves is None or found is None:
        return None
    names = [term.name for term in terms_of(cell)]
    return moves[:, [names.index(name) for name in found.names]]


def corrected_captures(cell: Cell, captures: Sequence[Capture], found: ArmModelFound | None) -> list[Capture]:
    """Return captures with poses corrected by the arm's errors, where these are applied and joints are known."""
    if found is None or not found.applied:
        return list(captures)
    after: list[Capture] = []
    for capture in captures:
        moves = None if capture.pose is None else moves_of(cell, capture)
        if moves is not None:
            pose = corrected_by(cell, found, pose_of(cell, capture), moves)
            capture = capture.model_copy(update={"pose": to_pose(cell.pose_convention, pose)})
        after.append(capture)
    return after
