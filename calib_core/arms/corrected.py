"""An arm as its errors make it: the table of joints by which it truly moves.

An arm's flange is a product of exponentials (Brockett, 1984): base_from_tool0 = Π exp(ŝₙ qₙ) exp(δ̂ₙ) · M, where ŝₙ
is the axis of joint n and M the flange with all joints at zero.  Errors of zeros and links are the δₙ between one
joint and the next; gathered, they move the joints' frames.
"""

from collections.abc import Mapping

import numpy as np

from calib_core.arms.errors import arm_moves, arm_terms
from calib_core.arms.kinematics import joint_frames
from calib_core.errors import ConflictError
from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.records import ArmJoint, ArmTable

_HALF_TURN = np.diag([1.0, -1.0, -1.0, 1.0])


def corrected_arm(arm: ArmTable, errors: Mapping[str, float]) -> tuple[ArmTable, tuple[str, ...]]:
    """Return an arm whose zeros and links are as its errors make them, and the errors that no table holds.

    Parameters
    ----------
    arm : ArmTable
    errors : mapping
        Values by the names of `arm_terms`.

    Raises
    ------
    ConflictError
        If a joint of the arm moves along with another.
    """
    if arm.couples:
        raise ConflictError(
            "an arm each of whose joints moves alone", "one whose joint moves along with another",
            "Use the list of corrected poses: scancell poses --corrected.", "cell.robot.arm",
        )  # fmt: skip
    zero = [0.0] * len(arm.joints)
    at, flange = joint_frames(arm, zero, zero)
    terms, moves = arm_terms(arm), arm_moves(arm, [zero])[0].T
    left_out = tuple(term.name for term in terms if term.name in errors and term.member in ("coupling", "sag"))
    moved, last, joints = np.eye(4), np.eye(4), list[ArmJoint]()
    for n, (joint, frame) in enumerate(zip(arm.joints, at, strict=True)):
        own = moved @ frame @ (_HALF_TURN if joint.sign < 0 else np.eye(4))
        place = np.linalg.inv(last) @ own
        name = joint.name or f"joint_{n + 1}"
        joints.append(
            ArmJoint(name=name, kind=joint.kind, limits=joint.limits, previous_from_joint=place.tolist())
        )
        last = own
        for term, move in zip(terms, moves, strict=True):
            if term.joint == n and term.name in errors and term.name not in left_out:
                moved = moved @ _moved_by(errors[term.name] * move, flange[:3, 3])
    table = ArmTable(
        joints=joints, last_from_tool0=(np.linalg.inv(last) @ moved @ flange).tolist(), source=arm.source
    )
    return table, left_out


def _moved_by(move: FloatArray, at_mm: FloatArray) -> FloatArray:
    """Return a motion (4, 4) that moves a place by the first three, mm, and turns it by the last, rad."""
    turn = rotation_from_vector(move[3:])
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = turn, at_mm + move[:3] - turn @ at_mm
    return found
