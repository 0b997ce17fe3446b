"""The recheck's step: three poses of the calibration again, the sphere still in its place."""

from typing import Any

import numpy as np

from calib_core.captures.poses import base_from_tool0_by_capture
from calib_core.errors import CalibrationError, MotionError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.records import GuideNow, Matrix4, Record, ResultsData, Session
from calib_core.records.base import Finite
from calib_core.stages.guide import GuideView
from calib_core.stages.recheck.solve import ENOUGH, is_repeated, require_still_sphere
from calib_core.stages.reviewed import review

_EXIT = message("{enough} poses of the calibration were captured again.", enough=ENOUGH)


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
    """Return the poses to repeat: three that the answer used, turned furthest apart.

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
    chosen = _furthest_apart([poses[c.id] for c in candidates])
    rows = [
        RepeatedPose(
            capture=c.id,
            pose=list(c.pose or []),
            base_from_tool0=poses[c.id].to_rows(),
            captured=next((a.id for a in reversed(again) if is_repeated(poses[a.id], poses[c.id])), None),
            axes_deg=c.axes_deg,
            axes_mm=c.axes_mm,
            scanner=c.scanner,
        )
        for c in (candidates[k] for k in chosen)
    ]
    needed = max(min(ENOUGH, len(rows)) - len(again), 0)
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
    if seen < ENOUGH:
        return GuideNow(
            step="recheck",
            stage="recheck",
            action="capture",
            instruction="Drive to another pose of the calibration and capture the sphere again, in its place.",
            why="The robot repeats a pose well: what is seen differently now has changed since.",
            exit=_EXIT,
            drawing="tcp-turn",
            progress=message("{seen} of {enough} captures", seen=seen, enough=ENOUGH),
            still_needed=ENOUGH - seen,
            **_next_pose(view),
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


def _next_pose(view: GuideView) -> dict[str, Any]:
    try:
        plan = recheck_plan(view.session, view.results)
    except CalibrationError:
        return {}
    left = next((pose for pose in plan.poses if pose.captured is None), None)
    if left is None:
        return {}
    note = message("the pose of {capture}", capture=left.capture)
    return {"suggested_pose": left.base_from_tool0, "suggested_pose_numbers": left.pose, "suggested_note": note}


def _furthest_apart(poses: list[RigidTransform]) -> list[int]:
    """Return three of the poses, each the furthest turned from those before it."""
    if len(poses) <= ENOUGH:
        return list(range(len(poses)))
    turns = np.array([[one.difference(other)[:3] for other in poses] for one in poses])
    apart = np.linalg.norm(turns, axis=2)
    chosen = [int(np.argmax(apart.sum(axis=1)))]
    while len(chosen) < ENOUGH:
        left = np.where(np.isin(np.arange(len(poses)), chosen), -1.0, apart[:, chosen].min(axis=1))
        chosen.append(int(np.argmax(left)))
    return sorted(chosen)
