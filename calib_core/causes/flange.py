"""Poses that are not the flange's in the base, as a known arm's joints tell: whose they are, and the way back."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.captures.contradictions import joints_contradict
from calib_core.causes.joints import likely_joints
from calib_core.errors import InputError
from calib_core.findings import Finding
from calib_core.findings.codes import arm as arm_codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.poses.identity import AGREE_DEG, AGREE_MM, identity_by_joints
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.records import BeforeAfter, Capture, Cell, Changes, FlangeReading, RootCause


def flange_findings(cell: Cell, captures: Sequence[Capture]) -> list[Finding]:
    """Return the tool or the frame that poses are of, with the way back; none where they are the flange's.

    Parameters
    ----------
    cell : Cell
    captures : sequence of Capture
        Those that are solved.

    Raises
    ------
    InputError
        If the arm is unknown, or a capture lacks a joint.
    """
    pairs = [pair for capture in captures if (pair := _by_joints(cell, capture)) is not None]
    found = identity_by_joints([pose for pose, _ in pairs], [flange for _, flange in pairs])
    if found is None:
        return _read_otherwise(cell, captures)
    if found.of_flange:
        return []
    reading = FlangeReading(
        tool0_from_tool=None if found.tool0_from_tool is None else found.tool0_from_tool.tolist(),
        base_from_frame=None if found.base_from_frame is None else found.base_from_frame.tolist(),
    )
    of = "frame" if reading.tool0_from_tool is None else "both" if reading.base_from_frame is not None else "tool"
    before = [_apart_mm(pose, flange) for pose, flange in pairs]
    after = [_apart_mm(brought(reading, pose), flange) for pose, flange in pairs]
    label = "Poses off those of the joints, median"
    evidence = BeforeAfter(label=label, unit="mm", before=float(np.median(before)), after=float(np.median(after)))
    remedy = RootCause(
        id="not-the-flange",
        kind="not-the-flange",
        evidence=[evidence],
        captures=[capture.id for capture in captures],
        changes=brought_back(reading, cell, captures),
        flange_reading=reading,
    )
    return [arm_codes.NOT_THE_FLANGE(whose=found.sentence, of=of, remedy=remedy)]


def _read_otherwise(cell: Cell, captures: Sequence[Capture]) -> list[Finding]:
    """Return that joints contradict the poses of most captures, with what would mend it."""
    apart = joints_contradict(cell, captures)
    likely = likely_joints(cell, captures) if apart else None
    if likely is None:
        return apart
    values = apart[0].values
    count, wrong = values["count"], values["apart"]
    return [arm_codes.JOINTS_READ_OTHERWISE(apart[0].captures, apart=wrong, count=count, likely=likely)]


def brought(reading: FlangeReading, pose: RigidTransform) -> RigidTransform:
    """Return the flange in the base out of a pose of a tool in a frame."""
    matrix = pose.matrix
    if reading.base_from_frame is not None:
        matrix = np.array(reading.base_from_frame) @ matrix
    if reading.tool0_from_tool is not None:
        matrix = matrix @ np.linalg.inv(np.array(reading.tool0_from_tool))
    return RigidTransform(matrix, "base", "tool0")


def brought_back(reading: FlangeReading, cell: Cell, captures: Sequence[Capture]) -> Changes:
    """Return what makes every pose of the flange; a capture of another tool, or of the flange already, is left."""
    usual = _usual(reading, cell, captures)
    patches: dict[str, dict[str, object]] = {}
    for capture in captures:
        pair = _pair_or_none(cell, capture)
        mine = _is_of(reading, *pair) if pair is not None else _same_tool(capture, usual)
        if mine and (patch := _rewritten(reading, cell.pose_convention, capture)):
            patches[capture.id] = patch
    return Changes(captures=patches)


def _usual(reading: FlangeReading, cell: Cell, captures: Sequence[Capture]) -> set[tuple[Any, Any]]:
    """Return the tools and frames, as the controller names them, that the reading is about."""
    found: set[tuple[Any, Any]] = set()
    for capture in captures:
        pair = _pair_or_none(cell, capture)
        if pair is not None and _is_of(reading, *pair):
            found.add((capture.active_tool, capture.active_frame))
    return found


def _same_tool(capture: Capture, usual: set[tuple[Any, Any]]) -> bool:
    return (capture.active_tool, capture.active_frame) in usual


def _by_joints(cell: Cell, capture: Capture) -> tuple[RigidTransform, RigidTransform] | None:
    """Return a capture's pose, and the flange's by its joints; None without an arm or joints."""
    if cell.robot.arm is None or capture.pose is None or not (capture.joints_deg or capture.joints_mm):
        return None
    from calib_core.arms.kinematics import arm_of, flange_of_joints

    try:
        flange = flange_of_joints(arm_of(cell.robot.arm), capture.joints_deg or [], capture.joints_mm)
    except InputError as error:
        raise error.at(capture.id) from None
    return pose_of(cell, capture), flange


def _pair_or_none(cell: Cell, capture: Capture) -> tuple[RigidTransform, RigidTransform] | None:
    try:
        return _by_joints(cell, capture)
    except InputError:
        return None


def _is_of(reading: FlangeReading, pose: RigidTransform, flange: RigidTransform) -> bool:
    back = brought(reading, pose)
    cosine = (float(np.trace(back.rotation.T @ flange.rotation)) - 1) / 2
    turn_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return _apart_mm(back, flange) <= 2 * AGREE_MM and turn_deg <= 2 * AGREE_DEG


def _apart_mm(one: RigidTransform, other: RigidTransform) -> float:
    off: FloatArray = one.translation_mm - other.translation_mm
    return float(np.linalg.norm(off))


def _rewritten(reading: FlangeReading, convention: str, capture: Capture) -> dict[str, object]:
    def back(numbers: Sequence[float]) -> list[float]:
        return to_pose(convention, brought(reading, parse_pose(convention, numbers)))

    patch: dict[str, object] = {}
    if capture.pose is not None:
        patch["pose"] = back(capture.pose)
    if capture.poses is not None:
        patch["poses"] = [back(pose) for pose in capture.poses]
    if capture.pose_track is not None:
        patch["pose_track"] = [{"t_s": timed.t_s, "pose": back(timed.pose)} for timed in capture.pose_track]
    return patch
