"""The recheck's step: three poses of the calibration again, the sphere still in its place."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from calib_core.captures.poses import base_from_tool0_by_capture
from calib_core.cell.carriers import scanner_name
from calib_core.errors import CalibrationError, MotionError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.records import Capture, GuideNow, Matrix4, Record, ResultsData, Session
from calib_core.records.base import Finite
from calib_core.stages.guide import GuideView
from calib_core.stages.recheck.solve import ENOUGH, is_repeated, require_still_sphere
from calib_core.stages.reviewed import review


class RepeatedPose(Record):
    """A pose of the calibration to capture again, as the controller wrote it; `captured` names who did.

    `axes_deg` and `axes_mm` are where the cell's named axes stood, `scanner` is whose capture it was.
    """

    capture: str
    pose: list[Finite]
    base_from_tool0: Matrix4
    captured: str | None = None
    axes_deg: dict[str, Finite] | None = None
    axes_mm: dict[str, Finite] | None = None
    scanner: str | None = None


class RecheckPlan(Record):
    """The poses whose captures tell whether a calibration still holds; the sphere must not have been moved."""

    pose_convention: str
    poses: list[RepeatedPose]
    still_needed: int


def recheck_plan(session: Session, results: ResultsData) -> RecheckPlan:
    """Return the poses to repeat: three of each scanner that the answer used, turned furthest apart.

    Raises
    ------
    MotionError
        If nothing was calibrated from captures of this session.
    """
    require_still_sphere(session)
    answer = results.get("chain") or results.get("tcp") or {}
    used = {row["capture"] for row in answer.get("residuals", []) if row.get("used")}
    candidates = [
        c for c in session.captures if c.step == "tcp" and c.id in used and not c.excluded and c.pose is not None
    ]
    if not candidates:
        to_do = "Solve the TCP first; a tool that was brought is verified instead."
        raise MotionError("a calibration that was solved from captures of this session", "none", to_do, "captures")
    again = [c for c in session.captures if c.step == "recheck" and not c.excluded and c.pose is not None]
    poses = base_from_tool0_by_capture(session.cell, [*candidates, *again])
    by = {c.id: scanner_name(session.cell, c) for c in (*candidates, *again)}
    of_each = [[c for c in candidates if by[c.id] == name] for name in dict.fromkeys(by.values())]

    def repeats(one: Capture, other: Capture) -> bool:
        return by[one.id] == by[other.id] and is_repeated(poses[one.id], poses[other.id])

    rows = [
        RepeatedPose(
            capture=c.id,
            pose=list(c.pose or []),
            base_from_tool0=poses[c.id].to_rows(),
            captured=next((a.id for a in reversed(again) if repeats(a, c)), None),
            axes_deg=c.axes_deg,
            axes_mm=c.axes_mm,
            scanner=c.scanner,
        )
        for own in of_each
        for c in _furthest_apart(own, poses)
    ]
    needed = max(len(rows) - len(again), 0)
    return RecheckPlan(pose_convention=session.cell.pose_convention, poses=rows, still_needed=needed)


def guide(view: GuideView) -> GuideNow | None:
    """Return the instruction of the recheck, None where nobody began it."""
    captures = view.captures("recheck")
    if not captures:
        return None
    fresh = view.fresh("recheck")
    if fresh is not None:
        look = "Look at the result: whether the calibration still holds."
        return review(fresh, look, step="recheck", exit_="It holds: go on scanning. It does not: calibrate again.")
    refused = {m.capture for m in view.measured if m.verdict == "fail"}
    seen = sum(capture.id not in refused for capture in captures)
    poses = _poses(view)
    enough = len(poses) or ENOUGH
    if seen < enough:
        return GuideNow(
            step="recheck",
            stage="recheck",
            action="capture",
            instruction="Drive to another pose of the calibration and capture the sphere again, in its place.",
            why="The robot repeats a pose well: what is seen differently now has changed since.",
            exit=message("{enough} poses of the calibration were captured again.", enough=enough),
            drawing="tcp-turn",
            progress=message("{seen} of {enough} captures", seen=seen, enough=enough),
            still_needed=enough - seen,
            **_next_pose(poses),
        )
    return GuideNow(
        step="recheck",
        stage="recheck",
        action="solve",
        instruction="Recheck the calibration.",
        why="Each capture is compared with that of the same pose at the calibration.",
        exit="The calibration holds, or it is said what changed.",
        drawing="tcp-solve",
        progress="enough captures",
    )


def _poses(view: GuideView) -> list[RepeatedPose]:
    with suppress(CalibrationError):
        return recheck_plan(view.session, view.results).poses
    return []


def _next_pose(poses: list[RepeatedPose]) -> dict[str, Any]:
    left = next((pose for pose in poses if pose.captured is None), None)
    if left is None:
        return {}
    note = message("the pose of {capture}", capture=left.capture)
    return {"suggested_pose": left.base_from_tool0, "suggested_pose_numbers": left.pose, "suggested_note": note}


def _furthest_apart(captures: list[Capture], poses: Mapping[str, RigidTransform]) -> list[Capture]:
    """Return three of the captures, each turned furthest from those before it."""
    if len(captures) <= ENOUGH:
        return captures
    turns = np.array([[poses[one.id].difference(poses[other.id])[:3] for other in captures] for one in captures])
    apart = np.linalg.norm(turns, axis=2)
    chosen = [int(np.argmax(apart.sum(axis=1)))]
    while len(chosen) < ENOUGH:
        left = np.where(np.isin(np.arange(len(captures)), chosen), -1.0, apart[:, chosen].min(axis=1))
        chosen.append(int(np.argmax(left)))
    return [captures[k] for k in sorted(chosen)]
