"""Captures that are kept but not used, because their records contradict each other or the cell."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.cell.carriers import scanner_names
from calib_core.cell.consistency import without_readings
from calib_core.errors import CalibrationError, InputError
from calib_core.findings import Code, Finding, about
from calib_core.findings.codes import arm as arm_codes
from calib_core.findings.codes import captures as codes
from calib_core.frames import RigidTransform, vector_from_rotation
from calib_core.messages import Value, message
from calib_core.poses.identity import AGREE_DEG, AGREE_MM
from calib_core.records import Capture, Cell

EXCLUDED = message("excluded by the user")
"""The reason of a capture that the user left out."""


NOT_A_FRAME = message("it is no frame of the camera")
"""The reason of a capture that is of no use where frames are; without places, since results keep it as text."""


def unfit(cell: Cell, captures: Sequence[Capture]) -> list[Finding]:
    """Return which captures of one step are not used: taken while moving, or otherwise than most.

    Poses are of one tool in one frame only where the controller had the same ones active; those of the minority
    are of another.  Joints that do not give the pose of a named arm mean that one of the two is another capture's;
    where that is so of most, the arm is at fault, and none is left out for it.

    Raises
    ------
    InputError
        If the arm is unknown.
    """
    found: list[Finding] = []
    moving = [c.id for c in captures if c.moving and c.kind != "sweep"]
    if moving:
        found.append(codes.CAPTURE_MOVING(moving))
    named = scanner_names(cell)
    known = ", ".join(sorted(named))
    others: dict[str, list[str]] = {}
    for capture in captures:
        if capture.scanner is not None and named and capture.scanner not in named:
            others.setdefault(capture.scanner, []).append(capture.id)
    found += [
        codes.CAPTURE_OF_OTHER_SCANNER(names, scanner=scanner, known=known) for scanner, names in others.items()
    ]
    lacking: dict[str, list[str]] = {}
    for capture, axis in without_readings(cell, captures):
        lacking.setdefault(axis, []).append(capture.id)
    found += [codes.CAPTURE_WITHOUT_READING(names, axis=axis) for axis, names in lacking.items()]
    settings = [("active_tool", "tool"), ("active_frame", "frame")]
    if not named:  # nobody said that there are several
        settings.append(("scanner", "scanner"))
    for field, setting in settings:
        for (own, usual), names in _minority(captures, field).items():
            found.append(codes.CAPTURE_OF_OTHER_TOOL(names, setting=setting, own=str(own), usual=str(usual)))
    if apart := _not_by_joints(cell, captures):
        found.append(codes.CAPTURE_NOT_BY_JOINTS(list(apart), each=apart))
    return first_reasons(found)


def without_scanner(cell: Cell, captures: Sequence[Capture]) -> list[Finding]:
    """Return that captures of a cell of several scanners name none, and whose they count as."""
    known = scanner_names(cell)
    silent = [one.id for one in captures if one.scanner is None and not one.excluded]
    if len(known) < 2 or not silent:
        return []
    return [codes.CAPTURE_OF_NO_SCANNER(silent, scanner=known[0], known=", ".join(known))]


def not_measured(failed: Mapping[str, CalibrationError], code: Code = codes.CAPTURE_NOT_MEASURED) -> list[Finding]:
    """Return captures that do not show what is measured, one finding a need."""
    groups: dict[tuple[str, str], dict[str, dict[str, Value]]] = {}
    for name, error in failed.items():
        cause = getattr(error.need, "template", error.need), getattr(error.got, "template", _kind_of(error.got))
        values: dict[str, Value] = {"need": error.need, "got": error.got, "to_do": error.to_do}
        groups.setdefault(cause, {})[name] = values
    return [code(list(each), each=each, first=next(iter(each))) for each in groups.values()]


def _kind_of(text: str) -> str:
    """Return a text without its numbers, by which captures of one cause differ."""
    return "".join(letter for letter in text if letter not in "-−+±0123456789.,")


def first_reasons(found: Sequence[Finding]) -> list[Finding]:
    """Return findings with each capture in the first that names it alone; those that are left without are gone."""
    seen: set[str] = set()
    kept: list[Finding] = []
    for finding in found:
        own = [name for name in finding.captures if name not in seen]
        seen.update(own)
        if own == finding.captures:
            kept.append(finding)
        elif own:
            kept.append(about(finding, own))
    return kept


def _minority(captures: Sequence[Capture], field: str) -> dict[tuple[Any, Any], list[str]]:
    """Return the captures whose value of a field is not that of most, by both; those without one are left."""
    values = {c.id: getattr(c, field) for c in captures if getattr(c, field) is not None}
    if len(set(values.values())) < 2:
        return {}
    usual = Counter(values.values()).most_common(1)[0][0]
    found: dict[tuple[Any, Any], list[str]] = {}
    for name, value in values.items():
        if value != usual:
            found.setdefault((value, usual), []).append(name)
    return found


def joints_contradict(cell: Cell, captures: Sequence[Capture]) -> list[Finding]:
    """Return that joints and poses of most captures contradict each other, where they do.

    Raises
    ------
    InputError
        If the arm is unknown, or a capture lacks a joint.
    """
    told = _with_joints(cell, captures)
    apart = _apart_by_joints(told)
    if 2 * len(apart) <= len(told):
        return []
    return [arm_codes.JOINTS_CONTRADICT(list(apart), apart=len(apart), count=len(told))]


def _not_by_joints(cell: Cell, captures: Sequence[Capture]) -> dict[str, dict[str, Value]]:
    """Return the captures whose joints give another pose than theirs; none where that is so of most."""
    told = _with_joints(cell, captures)
    found = _apart_by_joints(told)
    return found if 2 * len(found) <= len(told) else {}


def _apart_by_joints(told: dict[str, tuple[RigidTransform, RigidTransform]]) -> dict[str, dict[str, Value]]:
    """Return by capture how far its joints put the flange from its pose, where that is not an arm's error."""
    found: dict[str, dict[str, Value]] = {}
    for name, (pose, by_joints) in told.items():
        shift_mm = float(np.linalg.norm(pose.translation_mm - by_joints.translation_mm))
        turn = vector_from_rotation(by_joints.rotation.T @ pose.rotation)
        turn_deg = float(np.rad2deg(np.linalg.norm(turn)))
        if shift_mm > AGREE_MM or turn_deg > AGREE_DEG:
            found[name] = {"shift_mm": shift_mm, "turn_deg": turn_deg}
    return found


def _with_joints(cell: Cell, captures: Sequence[Capture]) -> dict[str, tuple[RigidTransform, RigidTransform]]:
    """Return by capture its pose, and the flange's by its joints; nothing where no arm is named."""
    if cell.robot.arm is None:
        return {}
    from calib_core.arms.kinematics import arm_of, flange_of_joints

    arm = arm_of(cell.robot.arm)
    found: dict[str, tuple[RigidTransform, RigidTransform]] = {}
    for capture in captures:
        if (capture.joints_deg or capture.joints_mm) and capture.pose is not None:
            try:
                by_joints = flange_of_joints(arm, capture.joints_deg or [], capture.joints_mm)
            except InputError as error:
                raise error.at(capture.id) from None
            found[capture.id] = (pose_of(cell, capture), by_joints)
    return found
