"""Poses of files and a known arm: joints beside poses say whose these are, poses and configuration give joints."""

from dataclasses import replace
from typing import TYPE_CHECKING

from calib_core.errors import InputError
from calib_core.messages import Message, message, plural
from calib_core.poses.identity import identity_by_joints
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.robots.controller_file import ControllerFile, Skipped
from calib_core.robots.resolve import UNSAID

if TYPE_CHECKING:
    from calib_core.records import ArmTable

_ANOTHER_ARM = 0.2  # the share of poses that do not fit from which on the arm, or its frames, are others


def without_arm(read: ControllerFile) -> ControllerFile:
    """Return what was read, with the places of which only joints are known among what was skipped."""
    to_do = message("Name the arm (cell.robot.arm), or record the Cartesian pose.")
    alone = [
        Skipped(one.line, message("{taught}: joints alone, no pose. {arm}", taught=one.name, arm=to_do), one.file)
        for one in read.poses
        if one.pose is None and one.joints_deg is not None
    ]
    skipped = sorted([*read.skipped, *alone], key=lambda row: (row.file, row.line))
    return replace(read, skipped=tuple(skipped))


def asked(read: ControllerFile, arm: str) -> ControllerFile:
    """Return what was read, with what the joints say about the poses, and joints of poses that have none.

    Where joints beside poses are the flange's in the base, what the files left open is settled; else a note says
    whose they are.  Other poses get their joints where the file says how the arm stands.

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
    from calib_core.arms.kinematics import arm_of  # knows the records, which know the conventions

    table = arm_of(arm)
    read = _with_poses(read, table, arm)
    if any(pose.as_written is not None and pose.joints_deg is not None for pose in read.poses):
        read, of_flange = _identified(read, table)
        if not of_flange:
            return read
    return _with_joints(read, table, arm)


def _with_poses(read: ControllerFile, table: "ArmTable", arm: str) -> ControllerFile:
    """Return poses of the flange where a file has joints alone, with a note of how many."""
    from calib_core.arms.kinematics import flange_of_joints

    poses = list(read.poses)
    alone = [k for k, one in enumerate(poses) if one.pose is None and one.joints_deg is not None]
    for k in alone:
        flange = flange_of_joints(table, poses[k].joints_deg or ())
        poses[k] = replace(poses[k], pose=tuple(v + 0.0 for v in to_pose(poses[k].convention, flange)))
    said = plural(
        "{count} pose follows from its joints by the nominal lengths of {arm}.",
        "{count} poses follow from their joints by the nominal lengths of {arm}.",
        by="count",
        count=len(alone),
        arm=arm,
    )
    return replace(read, poses=tuple(poses), notes=(*read.notes, said)) if alone else read


def _identified(read: ControllerFile, table: "ArmTable") -> tuple[ControllerFile, bool]:
    from calib_core.arms.kinematics import flange_of_joints

    both = [pose for pose in read.poses if pose.as_written is not None and pose.joints_deg is not None]
    poses = [parse_pose(pose.convention, pose.pose or ()) for pose in both]
    found = identity_by_joints(poses, [flange_of_joints(table, pose.joints_deg or ()) for pose in both])
    if found is None:
        said = plural(
            "{count} pose have joints beside them; they do not tell whose the poses are.",
            "{count} poses have joints beside them; they do not tell whose the poses are.",
            by="count",
            count=len(both),
        )
        return replace(read, notes=(*read.notes, said)), False
    if not found.of_flange:
        to_do = "Give the file that defines the tool or the frame, or record the flange in the base."
        return replace(read, notes=(*read.notes, f"{found.sentence} {to_do}")), False
    settled = [replace(pose, doubt=_without(pose.doubt)) for pose in read.poses]
    return replace(read, poses=tuple(settled), notes=(*read.notes, found.sentence)), True


def _without(doubt: str) -> str:
    for said in UNSAID.values():
        doubt = doubt.replace(said, "")
    return " ".join(doubt.split())


def _with_joints(read: ControllerFile, table: "ArmTable", arm: str) -> ControllerFile:
    """Return the poses with the joints in which the arm stands as the file says; a note counts what stays open."""
    from calib_core.arms.configuration import joints_by

    found: dict[int, tuple[float, ...]] = {}
    untold = unfit = 0
    try:
        for place, pose in enumerate(read.poses):
            if pose.pose is None or pose.joints_deg is not None:
                continue
            if pose.configuration is None or pose.doubt:
                untold += 1
                continue
            ways = joints_by(table, parse_pose(pose.convention, pose.pose), pose.configuration)
            unfit += not ways
            untold += len(ways) > 1
            if len(ways) == 1:
                found[place] = ways[0]
    except InputError as error:
        return replace(read, notes=(*read.notes, str(error)))
    if unfit > _ANOTHER_ARM * (unfit + len(found)):
        found = {}
    notes = _notes(arm, len(found), untold, unfit)
    poses = [replace(pose, joints_deg=found.get(k, pose.joints_deg)) for k, pose in enumerate(read.poses)]
    return replace(read, poses=tuple(poses), notes=(*read.notes, *notes))


def _notes(arm: str, found: int, untold: int, unfit: int) -> list[Message]:
    said: list[Message] = []
    if found:
        said.append(
            plural(
                "{count} pose has joints from itself and what the file says of how the arm stands, by the nominal "
                "lengths of {arm}.",
                "{count} poses have joints from themselves and what the file says of how the arm stands, by the "
                "nominal lengths of {arm}.",
                by="count",
                count=found,
                arm=arm,
            )
        )
    if unfit:
        said.append(
            plural(
                "{count} pose cannot be reached by {arm} as the file says that it stands. Make sure that it is "
                "this arm, and that poses are of its flange in its base; or record the joints.",
                "{count} poses cannot be reached by {arm} as the file says that it stands. Make sure that it is "
                "this arm, and that poses are of its flange in its base; or record the joints.",
                by="count",
                count=unfit,
                arm=arm,
            )
        )
    if untold:
        said.append(
            plural(
                "{count} pose stays without joints: the file does not say clearly how the arm stands there. "
                "Record its joints, which tell the arm's own errors.",
                "{count} poses stay without joints: the file does not say clearly how the arm stands there. "
                "Record their joints, which tell the arm's own errors.",
                by="count",
                count=untold,
            )
        )
    return said
