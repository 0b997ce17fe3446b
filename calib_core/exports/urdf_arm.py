"""URDF of the arm as it truly is: the joints by which the errors that were found move it."""

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np

from calib_core.arms.corrected import corrected_arm
from calib_core.arms.kinematics import arm_of
from calib_core.errors import ConflictError
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export, Settings
from calib_core.exports.neutral import position_and_quaternion, roll_pitch_yaw
from calib_core.exports.writing import provenance
from calib_core.frames import RigidTransform
from calib_core.records import ArmJoint, ArmTable
from calib_core.records.base import Matrix4
from calib_core.records.results import ArmModelFound


class ArmSettings(Settings):
    """What the robot and the links at both ends of its arm are called."""

    robot: str = "arm"
    base: str = "base"
    flange: str = "tool0"


def arm_and_errors(answer: Answer) -> tuple[str | ArmTable, dict[str, float]]:
    """Return a session's arm and the errors that an answer knows of it, by the names of its terms.

    Raises
    ------
    ConflictError
        If it knows none.
    """
    found, arm = answer.results.get(answer.stage, {}).get("arm_model"), answer.session.cell.robot.arm
    if arm is None or found is None:
        raise ConflictError(
            "an answer that knows the arm's errors", "one without them",
            "Give cell.robot.arm and the captures' joints, and solve.", answer.stage,
        )  # fmt: skip
    model = ArmModelFound.model_validate(found)
    return arm, dict(zip(model.names, model.values, strict=True))


def _write(answer: Answer, settings: ArmSettings) -> str:
    arm, errors = arm_and_errors(answer)
    table, left_out = corrected_arm(arm_of(arm), errors)
    told = [
        *provenance(answer, of_arm=True),
        "The arm's joints with the errors that were found; of use beside the scanner's frame by poses=corrected.",
        *(f"Not among them, as no URDF has it: {name} {errors[name]:.6g}" for name in left_out),
    ]
    lines = ['<?xml version="1.0"?>', *(f"<!-- {line.replace('--', '-')} -->" for line in told)]
    lines += [f"<robot name={quoteattr(settings.robot)}>", f"  <link name={quoteattr(settings.base)}/>"]
    parent = settings.base
    for n, joint in enumerate(table.joints):
        child = f"link_{n + 1}"
        assert joint.name is not None
        lines += _joint(joint.name, joint.kind, parent, child, joint.previous_from_joint, _moves(joint))
        parent = child
    lines += _joint("flange", "fixed", parent, settings.flange, table.last_from_tool0, [])
    return "\n".join([*lines, "</robot>"]) + "\n"


def _joint(
    name: str, kind: str, parent: str, child: str, place: Matrix4 | None, moves: list[str]
) -> Iterator[str]:
    assert place is not None
    frame = RigidTransform.from_rounded(place, "base", "tool0")  # what they are called does not matter here
    position, angles = position_and_quaternion(frame)[0], roll_pitch_yaw(frame)
    yield f"  <link name={quoteattr(child)}/>"
    yield f'  <joint name={quoteattr(name)} type="{kind}">'
    yield f"    <parent link={quoteattr(parent)}/>"
    yield f"    <child link={quoteattr(child)}/>"
    yield f'    <origin xyz="{" ".join(position)}" rpy="{" ".join(angles)}"/>'
    yield from moves
    yield "  </joint>"


def _moves(joint: ArmJoint) -> list[str]:
    """Return along what a joint moves and how far, rad or m; without limits as far as its number can be told."""
    low, high = joint.limits or ((-360.0, 360.0) if joint.kind == "revolute" else (-1e4, 1e4))
    unit = np.deg2rad(1.0) if joint.kind == "revolute" else 1e-3
    limits = f'lower="{low * unit:.9g}" upper="{high * unit:.9g}" effort="0" velocity="0"'
    return ['    <axis xyz="0 0 1"/>', f"    <limit {limits}/>"]


EXPORT = Export("urdf-arm", "URDF: the arm with its errors", "application/xml", ".urdf", _write, ArmSettings)
