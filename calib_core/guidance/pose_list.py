"""Planned poses as a list for the controller: numbers in the user's convention, each with its approach."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib_core.errors import ConflictError
from calib_core.evidence.numbers import COVERAGE
from calib_core.frames import RigidTransform
from calib_core.guidance.known import situation_of
from calib_core.guidance.planner import Situation, planned_set
from calib_core.records import Matrix4, Measured, Record, Session
from calib_core.robots import to_pose

APPROACH_MM = 150.0
SPEED_MM_S = 50.0
_WELL_KNOWN_MM = 10.0  # ± of the tool's place beyond which no approach is given: the scanner could touch


class PoseOfSet(Record):
    """A pose of the flange in base, as 4×4 and as the controller writes it; the ± after it (k = 2).

    `uncertainty_mm` is at the workpiece. `approach_numbers` is where its approach begins, straight away from the
    sphere; null where the tool is not known well enough to move by.
    """

    base_from_tool0: Matrix4
    numbers: list[float]
    approach_numbers: list[float] | None
    uncertainty_mm: float | None


class PoseList(Record):
    """Poses for the next captures, in the order in which they help most.

    The operator starts every move, in manual mode at `speed_mm_s` at most; `note` says what to mind.
    """

    pose_convention: str
    speed_mm_s: float
    poses: list[PoseOfSet]
    note: str


def planned_poses(
    session: Session, measured: Sequence[Measured], results: Mapping[str, Mapping[str, Any]], captures: int
) -> PoseList:
    """Return a planned set for the next captures of the still sphere.

    Raises
    ------
    ConflictError
        If too little is known of tool and sphere, or the limits leave too few poses.
    """
    situation = situation_of(session, measured, results)
    if situation is None:
        raise ConflictError(
            "a tool and a sphere's place that are known about",
            "neither captures nor `cell.nominal`",
            "Take the captures that the guide asks for, or give `cell.nominal` from a drawing.",
            "cell.nominal",
        )
    try:
        plan = planned_set(situation, captures, grid=max(200, 3 * captures), sweeps=1)
    except ValueError as error:
        to_do = "Widen `cell.limits`, or ask for fewer."
        raise ConflictError(f"{captures} poses that the limits allow", str(error), to_do, "cell.limits") from None
    sure = _tool_known(situation)
    convention = session.cell.pose_convention
    poses = [
        PoseOfSet(
            base_from_tool0=pose.to_rows(),
            numbers=to_pose(convention, pose),
            approach_numbers=to_pose(convention, _approach(situation, pose)) if sure else None,
            uncertainty_mm=COVERAGE * sigma if sigma < 20.0 else None,
        )
        for pose, sigma in zip(plan.poses.poses, plan.after_mm.tolist(), strict=True)
    ]
    note = (
        "Go to each approach first, then straight to the pose: in manual mode, at reduced speed, one at a time."
        if sure
        else "The tool is not known well enough for approaches: drive by hand, and shift until the sphere is seen."
    )
    return PoseList(pose_convention=convention, speed_mm_s=SPEED_MM_S, poses=poses, note=note)


def _tool_known(situation: Situation) -> bool:
    """Return whether the tool keeps the scanner clear of the sphere: by the captures, or by a drawing."""
    from calib_core.guidance.design import Design

    given = situation.assumed
    if given.tool_sigma_mm * COVERAGE <= _WELL_KNOWN_MM:
        return True
    if not situation.taken:
        return False
    covariance = Design(situation.taken, given).tool(range(len(situation.taken)))
    return COVERAGE * float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1])) <= _WELL_KNOWN_MM


def _approach(situation: Situation, pose: RigidTransform) -> RigidTransform:
    """Return the pose drawn back along the line from the sphere to the scanner."""
    given = situation.assumed
    scanner = pose.apply(given.tool0_from_laser.translation_mm)
    away = scanner - given.center_in_base_mm
    away = away / float(np.linalg.norm(away)) * APPROACH_MM
    return RigidTransform.of(pose.rotation, pose.translation_mm + away, "base", "tool0")
