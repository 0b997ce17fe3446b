"""Planned poses as a list for the controller: numbers in the user's convention, each with its approach."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib_core.cell.axes import TABLE, names_axes, robot_on_axes
from calib_core.cell.carriers import ball_on_flange, scanner_names
from calib_core.cell.found import ball_at, turns_little
from calib_core.errors import ConflictError
from calib_core.evidence.numbers import COVERAGE
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.planner import Situation, planned_set
from calib_core.guidance.prior import situation_of
from calib_core.guidance.solved_cell import SolvedCell, solved_cell
from calib_core.guidance.solved_plan import Shot, planned_captures
from calib_core.guidance.table_advice import planned_shots, table_situation
from calib_core.messages import Message, message
from calib_core.poses.numbers import to_pose
from calib_core.records import Cell, Matrix4, Measured, Record, ResultsData, Session
from calib_core.records.base import PlannedStep
from calib_core.steps import table_stages, tool_stages

APPROACH_MM = 150.0
SPEED_MM_S = 50.0
_LITTLE = 0.98  # of the ± after the first of a set: a set that leaves more changes nothing
_WELL_KNOWN_MM = 10.0  # ± of the tool's place beyond which no approach is given: the scanner could touch


class PoseOfSet(Record):
    """A pose of the flange in base, as 4×4 and as the controller writes it; the ± after it (k = 2).

    `uncertainty_mm` is at the workpiece. `approach_numbers` is where its approach begins, straight away from the
    sphere; null where the tool is not known well enough to move by. Of a pose for the turntable, `table_deg` is
    the table's angle, `mount` the sphere's place and `higher_mm` how much higher it is to be fixed before; where
    spheres' sizes differ, `mount` of a pose that verifies is the sphere's name;
    `axes_deg` and `axes_mm` are where a cell's named axes are to stand, `scanner` is whose capture it is.
    """

    base_from_tool0: Matrix4
    numbers: list[float]
    approach_numbers: list[float] | None
    uncertainty_mm: float | None
    table_deg: float | None = None
    mount: str | None = None
    higher_mm: float | None = None
    axes_deg: dict[str, float] | None = None
    axes_mm: dict[str, float] | None = None
    scanner: str | None = None


class PoseList(Record):
    """Poses for the next captures, in the order in which they help most.

    The operator starts every move, in manual mode at `speed_mm_s` at most; `note` says what to mind. `by_robot` is
    false where the robot's pose does not matter.
    """

    step: PlannedStep = "tcp"
    pose_convention: str
    speed_mm_s: float
    poses: list[PoseOfSet]
    note: str
    by_robot: bool = True


def planned_poses(
    session: Session, measured: Sequence[Measured], results: ResultsData, captures: int, step: PlannedStep = "tcp"
) -> PoseList:
    """Return a planned set for the next captures of a step.

    Those of `verify` keep away from the calibration's poses, and are chosen by what they tell alone.

    Raises
    ------
    ConflictError
        If too little is known of tool and sphere, or the limits leave too few poses.
    """
    if _as_solved(session.cell, results, step):
        known = solved_cell(session, measured, results)
        if known is not None or step == "turntable":
            known = _solved(known, results)
            if step == "verify":
                places = zip(known.mounts, known.layout.places, known.position.places, strict=True)
                mounts = [mount or ball_at(session.cell, results, on, at) for mount, (on, _), at in places]
                known = replace(known, mounts=mounts)
            return _of_solved(session, known, captures, step)
    if step == "turntable":
        return _for_table(session, measured, results, captures)
    situation = situation_of(session, measured, results, step)
    if situation is None and ball_on_flange(session.cell):
        to_do = message("Take the captures that the guide asks for.")
        raise _failed(results) or ConflictError(
            "the scanner's place and the ball's, known about", "too few captures", to_do, "captures"
        )
    if situation is None:
        need = message("a tool and a sphere's place that are known about")
        raise _failed(results) or _too_little(need, "cell.nominal")
    try:
        plan = planned_set(situation, captures, grid=max(200, 3 * captures), sweeps=1)
    except ValueError as error:
        raise _too_few(captures, str(error)) from None
    sure = _tool_known(situation)
    poses = [
        _listed(session, situation, pose, sure, situation.assumed.center_mm, sigma)
        for pose, sigma in zip(plan.poses.poses, plan.after_mm.tolist(), strict=True)
    ]
    if step == "verify":
        on, at = situation.room.sight.carriers.ball, situation.assumed.center_mm
        mount = ball_at(session.cell, results, on, at) or None
        poses = [one.model_copy(update={"mount": mount}) for one in poses]
    found = _list_of(session, step, poses, sure)
    if situation.with_arm is None:
        return found
    reached = message("{note} The arm's joints reach each of them.", note=found.note)
    return found.model_copy(update={"note": reached})


def _as_solved(cell: Cell, results: ResultsData, step: PlannedStep) -> bool:
    """Return whether poses follow from the solution: of named axes, a still scanner's table, or few motions.

    Also of several scanners, and of a robot on axes, once these are solved.
    """
    if step == "turntable" and (names_axes(cell) or ball_on_flange(cell)):
        return True
    solved = [results[stage] for stage in (*tool_stages(), *table_stages()) if results.get(stage)]
    several = len(scanner_names(cell)) > 1 or robot_on_axes(cell)
    return (several and bool(solved)) or any(map(turns_little, solved))


def _solved(known: SolvedCell | None, results: ResultsData) -> SolvedCell:
    if known is not None:
        return known
    to_do = message("Take the captures that the guide asks for, and solve them.")
    need = "a cell that is solved, its axes too"
    raise _failed(results) or ConflictError(need, "one that is not", to_do, "captures")


def _of_solved(session: Session, known: SolvedCell, captures: int, step: PlannedStep) -> PoseList:
    """Return further captures of a cell whose edges are solved, whatever they are."""
    if step == "turntable" and not any(known.rides(place) for place in range(len(known.layout.places))):
        to_do = message("Take one round of captures of it as the guide says, or ask for step 'tcp'.")
        raise ConflictError("a sphere on an axis that was captured", "none", to_do, "captures")
    shots = planned_captures(known, captures, on_axes=step == "turntable", verifying=step == "verify")
    if len(shots) < captures:
        raise _too_few(
            captures, message("{count} allowed poses, {captures} wanted", count=len(shots), captures=captures)
        )
    kinds = {axis.name: axis.kind for axis in known.layout.axes}
    several = len(known.layout.mounts) > 1
    poses = [_of_shot(session, shot, kinds, several) for shot in shots]
    found = _list_of(session, step, poses, all(shot.approach is not None for shot in shots))
    by_robot = any(shot.by_robot for shot in shots)
    return found.model_copy(update={"note": _note_of_solved(shots, by_robot), "by_robot": by_robot})


def _of_shot(session: Session, shot: Shot, kinds: Mapping[str, str], several: bool) -> PoseOfSet:
    convention, named = session.cell.pose_convention, names_axes(session.cell)
    degrees = {n: float(np.rad2deg(v)) for n, v in shot.readings.items() if kinds[n] == "rotary"}
    return PoseOfSet(
        base_from_tool0=shot.pose.to_rows(),
        numbers=to_pose(convention, shot.pose),
        approach_numbers=None if shot.approach is None else to_pose(convention, shot.approach),
        uncertainty_mm=COVERAGE * shot.after_mm if shot.after_mm < 20.0 else None,
        table_deg=None if named else degrees.get(TABLE),
        mount=shot.mount or None,
        axes_deg=(degrees or None) if named else None,
        axes_mm={n: v for n, v in shot.readings.items() if kinds[n] == "linear"} or None,
        scanner=shot.scanner if several else None,
    )


def _note_of_solved(shots: Sequence[Shot], by_robot: bool) -> Message:
    note = _how_to_take(shots, by_robot)
    if len(shots) > 1 and shots[-1].after_mm > _LITTLE * shots[0].after_mm:
        return message(
            "{note} They change it little: what is left is what all captures share, as errors of the scanner.",
            note=note,
        )
    return note


def _how_to_take(shots: Sequence[Shot], by_robot: bool) -> Message:
    if not by_robot:
        return message(
            "Move the axes alone: neither scanner nor sphere is on the robot, and its pose does not matter."
        )
    if any(shot.readings for shot in shots):
        first = message("Move the axes first, with the scanner away from what they carry.")
        return message("{note} Each ± is of where a sphere is seen, at worst.", note=first)
    return message(
        "Only orientations that the machine took before. Each ± is of where the sphere is seen, at worst."
    )


def _for_table(session: Session, measured: Sequence[Measured], results: ResultsData, captures: int) -> PoseList:
    now = table_situation(session, measured, results)
    if now is None:
        need = message("a tool, and a table that is known about: three captures of one place of the sphere on it")
        raise _failed(results) or _too_little(need, "cell.nominal.base_from_turntable")
    shots = planned_shots(now, captures)
    if len(shots) < captures:
        raise _too_few(
            captures, message("{count} allowed poses, {captures} wanted", count=len(shots), captures=captures)
        )
    sure = _tool_known(now.still)
    poses: list[PoseOfSet] = []
    for shot in shots:
        listed = _listed(session, now.still, shot.pose, sure, shot.center_in_base_mm, shot.after_mm)
        told = {"table_deg": shot.table_deg, "mount": shot.mount, "higher_mm": shot.higher_mm}
        poses.append(listed.model_copy(update=told))
    return _list_of(session, "turntable", poses, sure)


def _too_little(need: str, where: str) -> ConflictError:
    to_do = message("Take the captures that the guide asks for, or give `{place}` from a drawing.", place=where)
    return ConflictError(need, "too few captures, and no `{place}`", to_do, where, place=where)


def _failed(results: ResultsData) -> ConflictError | None:
    """Return that an answer failed, by which poses would be planned: more captures alone may not mend it."""
    failed = [s for s in (*tool_stages(), *table_stages()) if (results.get(s) or {}).get("verdict") == "fail"]
    if not failed:
        return None
    to_do = message("Do what its findings say, and solve it again.")
    return ConflictError("an answer to plan by", "one that failed: '{stage}'", to_do, failed[0], stage=failed[0])


def _too_few(captures: int, got: str) -> ConflictError:
    to_do = message("Widen `cell.limits`, or ask for fewer.")
    return ConflictError("{captures} poses that the limits allow", got, to_do, "cell.limits", captures=captures)


def _listed(
    session: Session,
    situation: Situation,
    pose: RigidTransform,
    sure: bool,
    center_mm: FloatArray,
    sigma_mm: float,
) -> PoseOfSet:
    convention = session.cell.pose_convention
    approach = _approach(situation, pose, center_mm)
    return PoseOfSet(
        base_from_tool0=pose.to_rows(),
        numbers=to_pose(convention, pose),
        approach_numbers=to_pose(convention, approach) if sure else None,
        uncertainty_mm=COVERAGE * sigma_mm if sigma_mm < 20.0 else None,
    )


def _list_of(session: Session, step: PlannedStep, poses: list[PoseOfSet], sure: bool) -> PoseList:
    note = (
        "Go to each approach first, then straight to the pose: in manual mode, at reduced speed, one at a time."
        if sure
        else "The tool is not known well enough for approaches: drive by hand, and shift until the sphere is seen."
    )
    if step == "turntable":
        note = message("Turn the table first, with the scanner away from it. {note}", note=note)
    convention = session.cell.pose_convention
    return PoseList(step=step, pose_convention=convention, speed_mm_s=SPEED_MM_S, poses=poses, note=note)


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


def _approach(situation: Situation, pose: RigidTransform, center_mm: FloatArray) -> RigidTransform:
    """Return the pose drawn back along the line between sphere and scanner."""
    carried, still = situation.room.ends(pose, situation.assumed.mount_from_laser, center_mm)
    away = carried - still
    away = away / float(np.linalg.norm(away)) * APPROACH_MM
    return RigidTransform.of(pose.rotation, pose.translation_mm + away, "base", "tool0")
