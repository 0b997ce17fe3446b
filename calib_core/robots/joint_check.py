"""Poses of files whose joints stand beside them: a known arm is asked whose they are."""

from dataclasses import replace

from calib_core.messages import plural
from calib_core.poses.identity import identity_by_joints
from calib_core.poses.numbers import parse_pose
from calib_core.robots.controller_file import ControllerFile
from calib_core.robots.resolve import UNSAID


def asked(read: ControllerFile, arm: str) -> ControllerFile:
    """Return what was read, with what the joints say about the poses.

    Where they are the flange's in the base, what the files left open is settled; else a note says whose they are.

    Parameters
    ----------
    read : ControllerFile
    arm : str
        Its name, as in `cell.robot.arm`.

    Raises
    ------
    InputError
        If there is no arm of this name, or a pose has too few joints for it.
    """
    from calib_core.arms.kinematics import (
        arm_of,
        flange_of_joints,
    )  # knows the records, which know the conventions

    table = arm_of(arm)
    both = [pose for pose in read.poses if pose.pose is not None and pose.joints_deg is not None]
    poses = [parse_pose(pose.convention, pose.pose or ()) for pose in both]
    found = identity_by_joints(poses, [flange_of_joints(table, pose.joints_deg or ()) for pose in both])
    if found is None:
        said = plural(
            "{count} pose have joints beside them; they do not tell whose the poses are.",
            "{count} poses have joints beside them; they do not tell whose the poses are.",
            by="count",
            count=len(both),
        )
        return replace(read, notes=(*read.notes, said))
    if not found.of_flange:
        to_do = "Give the file that defines the tool or the frame, or record the flange in the base."
        return replace(read, notes=(*read.notes, f"{found.sentence} {to_do}"))
    settled = [replace(pose, doubt=_without(pose.doubt)) for pose in read.poses]
    return replace(read, poses=tuple(settled), notes=(*read.notes, found.sentence))


def _without(doubt: str) -> str:
    for said in UNSAID.values():
        doubt = doubt.replace(said, "")
    return " ".join(doubt.split())
