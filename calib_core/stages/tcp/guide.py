"""The TCP step: what to do now, from what the captures' poses and arcs give already."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.cell.carriers import ball_on_flange, scanner_names, stands_apart
from calib_core.cell.found import carriers_found, turns_little
from calib_core.cell.in_hand import in_hand, only_scanner, scanners_left
from calib_core.chain.two_step import EQUAL_ORIENTATION_RAD
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.advice import Advice, amount, tcp_advice
from calib_core.guidance.sphere_guess import SeenCenter, probable_place
from calib_core.messages import Message, message, sentences
from calib_core.records import Capture, Cell, GuideNow, Measured
from calib_core.stages.guide import GuideView
from calib_core.stages.reviewed import OF_BALL, as_sentence, review, suggested
from calib_core.stages.tcp.instructions import (
    SOLVE,
    contradicted,
    first,
    mend_pose,
    shift,
    solve,
    solve_of_few_axes,
    turn,
)
from calib_core.stages.tcp.motion import (
    GOOD_TURNS,
    LEAST_SHIFTS,
    WANTED_SHIFTS,
    WANTED_TURNS,
    Motion,
    motion_of,
)
from calib_core.stages.turntable.guide import wants_turntable

_PLACE_KNOWN_MM = 15.0  # a scanner's place known so well keeps the sphere in view while the flange turns
_MANY = 12  # so many captures of different orientations do without pure translations


def guide(view: GuideView) -> GuideNow | None:
    """Return the instruction of the TCP step, None where the tool is given with the cell."""
    of_all, view = view.session, replace(view, session=in_hand(view.session))
    now = _guide(view)
    if (
        now is not None
        and now.action != "capture"
        and (left := scanners_left(of_all, solved=now.action == "review"))
    ):
        view = replace(view, session=only_scanner(of_all, left[0]))
        now = _guide(view)
    if now is not None and now.action == "capture" and view.session is not of_all:
        (scanner,) = scanner_names(view.session.cell)
        progress = message("Scanner {scanner}: {progress}", scanner=scanner, progress=now.progress)
        now = now.model_copy(update={"progress": progress})
    if now is None or not ball_on_flange(view.session.cell):
        return now
    drawing = OF_BALL.get(now.drawing, now.drawing)
    words = "Solve where the scanner stands." if now.instruction == SOLVE else now.instruction
    return now.model_copy(update={"drawing": drawing, "instruction": words})


def _guide(view: GuideView) -> GuideNow | None:
    if view.statuses["tcp"] == "known":
        return None
    session, measured = view.session, view.measured
    result = view.results.get("tcp") or view.results.get("chain")
    captures = view.captures("tcp")
    if not captures:
        return first(session.cell)
    poses, unread = _poses(session.cell, captures)
    if unread:
        return mend_pose(unread)
    verdicts = {m.capture: m.verdict for m in measured}
    usable = [pose for capture, pose in poses.items() if verdicts.get(capture) != "fail"]
    if not usable:
        return first(session.cell)
    fresh = None if result is None or result.get("stale") else result
    if fresh and fresh.get("up_to_shift") and wants_turntable(session):
        return None  # what the machine's motions leave open does not matter for a part on the table
    advice = tcp_advice(session, measured, view.results)
    if fresh is not None and turns_little(fresh):
        return _reviewed_of_few_axes(fresh)
    if fresh is not None:
        return _reviewed(session.cell, review(fresh), advice)
    if advice is not None and (advice.contradicted or advice.apart):
        return contradicted(advice)
    motion = motion_of(usable)
    if len(usable) >= _MANY and len(motion.shifts_mm) >= LEAST_SHIFTS and not motion.turns_differ:
        return solve_of_few_axes(again=result is not None)
    if advice is not None:
        return _by_worth(session.cell, advice, again=result is not None)
    home = usable[motion.reference]
    shifts, turns = len(motion.shifts_mm), len(motion.turns_rad)
    turned = turns >= WANTED_TURNS and motion.turns_differ
    shifted = shifts >= WANTED_SHIFTS and motion.shifts_differ
    if turned and (shifted or len(usable) >= _MANY):
        return solve(turns, again=result is not None)
    if not shifted:
        return shift(session.cell, motion, home)
    names = [name for name in poses if verdicts.get(name) != "fail"]
    return turn(session.cell, motion, home, _sphere(session.cell, names, poses, measured, motion, result))


def _reviewed_of_few_axes(result: Mapping[str, Any]) -> GuideNow:
    """Return the look at a result of a machine that does not turn: a tilt that it cannot make is not asked for."""
    now = review({**result, "undetermined": []})
    if result.get("verdict") == "fail":
        return now
    why = message(
        "What the machine's motions leave open moves all scans alike: they are merged without it. Where the place "
        "in base matters, tilt the flange if the machine can, or measure that place."
    )
    count = len(result.get("undetermined", []))
    return now.model_copy(update={"why": why, "progress": message("solved; {count} left open", count=count)})


def _reviewed(cell: Cell, now: GuideNow, advice: Advice | None) -> GuideNow:
    """Return the look at a result with what it is worth; where more is wanted, the capture that helps most."""
    if advice is None:
        return now
    meter = advice.meter
    if meter.wanted_mm is not None and meter.enough and now.action == "review":
        return now.model_copy(
            update={"meter": meter, "progress": message("enough: {advice}", advice=advice.words())}
        )
    more = meter.wanted_mm is not None and not meter.enough and now.action == "review" and meter.still_needed != 0
    if advice.next is None or not (more or now.action == "capture"):
        return now.model_copy(update={"meter": meter})
    step = _by_worth(cell, advice, again=False)
    if now.action == "capture":
        step = step.model_copy(update={"instruction": now.instruction, "drawing": now.drawing})
    return step


def _by_worth(cell: Cell, advice: Advice, *, again: bool) -> GuideNow:
    """Return the capture that takes most off the uncertainty at the workpiece; enough of them: the solve."""
    meter, pose = advice.meter, advice.next
    if meter.enough or pose is None:
        progress = (
            message("enough: {advice}", advice=advice.words())
            if meter.enough
            else message("no pose is left that the limits allow: {advice}", advice=advice.words())
        )
        enough = solve(GOOD_TURNS, again=again)
        why = message("At the workpiece {advice}, by the poses and arcs so far.", advice=advice.words())
        return enough.model_copy(update={"why": why, "progress": progress, "meter": meter})
    more = meter.still_needed
    progress = advice.words()
    if more is not None and meter.wanted_mm is not None:
        progress = message("{progress}, about {count} more", progress=progress, count=more)
    note = (
        "The sphere stays in view there, as far as is known."
        if pose.sure
        else message(
            "The sphere may be {doubt_mm:.0f} mm beside its place in the view: go there slowly, and "
            "shift the scanner until it sees the sphere as before.",
            doubt_mm=pose.doubt_mm,
        )
    )
    better = (
        message("by it alone the workpiece is not determined yet")
        if meter.after_next_mm is None
        else message(
            "after it the workpiece is known to {after_next_mm}", after_next_mm=amount(meter.after_next_mm)
        )
        if meter.uncertainty_mm is None
        else message(
            "at the workpiece from {uncertainty_mm} to {after_next_mm}",
            uncertainty_mm=amount(meter.uncertainty_mm),
            after_next_mm=amount(meter.after_next_mm),
        )
    )
    why = [message("No other pose tells more: {better}.", better=better)]
    if advice.open_directions:
        still_open = as_sentence(advice.open_directions[0])
        why.append(message("Still open: {open_directions}", open_directions=still_open))
    why += _why_for_arm(advice)
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="capture",
        instruction="Move the flange to the pose below and capture the sphere.",
        why=sentences(why),
        exit=message("{wanted_mm} at the workpiece, as wanted.", wanted_mm=amount(meter.wanted_mm))
        if meter.wanted_mm is not None
        else "Nothing is left open, and another capture would change little.",
        drawing="tcp-turn",
        progress=progress,
        still_needed=more or 1,
        meter=meter,
        **suggested(cell, pose.base_from_tool0, note),
    )


def _why_for_arm(advice: Advice) -> list[Message]:
    """Return what the pose tells of the arm's own errors, and when these are worth solving."""
    if advice.arm is None:
        return []
    from calib_core.stages.tcp.arm_found import term_label

    term, count = term_label(advice.arm.term), advice.arm.worth_from
    told = [
        message("The arm reaches it; of the arm's own errors it tells most about this one: {term}.", term=term)
    ]
    if count is not None:
        told.append(message("These are worth solving from about {count} captures on.", count=count))
    return told


def _sphere(
    cell: Cell,
    names: Sequence[str],
    poses: Mapping[str, RigidTransform],
    measured: Sequence[Measured],
    motion: Motion,
    result: Mapping[str, Any] | None,
) -> tuple[FloatArray | None, str]:
    """Return where the sphere is in base, as solved or else as guessed, and what that rests on."""
    home = poses[names[motion.reference]]
    if result:
        return _solved_center(result, home), "The flange turns about the sphere: the scanner goes on seeing it."
    if ball_on_flange(cell):
        return None, "Only the orientation is meant: move the ball until the scanner sees it as before."
    seen = {m.capture: _seen(cell, poses[m.capture], m) for m in measured if m.capture in names}
    found = [(name, one) for name, one in seen.items() if one is not None]
    alike = {
        name for name in names if np.linalg.norm(home.rotation - poses[name].rotation) < EQUAL_ORIENTATION_RAD
    }
    shifted = [one for name, one in found if name in alike]
    place = probable_place(shifted, [one for name, one in found if name not in alike])
    if place is None:
        return None, "Only the orientation is meant: shift the scanner until it sees the sphere as before."
    if place.scanner_sigma_mm > _PLACE_KNOWN_MM:
        return (
            place.center_in_base_mm,
            "This assumes that the scanner sits at the flange itself, as far as no turn has told where it sits. "
            "Shift it until it sees the sphere as before; the next proposals will be nearer.",
        )
    return (
        place.center_in_base_mm,
        message(
            "The flange turns about the place where the captures so far put the sphere, about "
            "±{scanner_sigma_mm:.0f}\xa0mm.",
            scanner_sigma_mm=2 * place.scanner_sigma_mm,
        ),
    )


def _solved_center(result: Mapping[str, Any], home: RigidTransform) -> FloatArray:
    """Return where the sphere is in base at a pose."""
    carriers = carriers_found(result)
    return carriers.ball_in_base(np.array(result[f"sphere_center_in_{carriers.ball}_mm"]), home)


def _seen(cell: Cell, pose: RigidTransform, measured: Measured) -> SeenCenter | None:
    """Return a capture's own centre of the sphere; of a profile y is what its circle leaves of the radius."""
    center, radius_mm = measured.center_mm, (cell.sphere_diameter_mm or 0.0) / 2
    if center is None:
        return None
    if len(center) == 3:
        return SeenCenter(pose, np.array(center), False)
    height_mm = float(np.sqrt(max(0.0, radius_mm**2 - (measured.radius_mm or radius_mm) ** 2)))
    return SeenCenter(pose, np.array([center[0], height_mm, center[1]]), True)


def _poses(cell: Cell, captures: Sequence[Capture]) -> tuple[dict[str, RigidTransform], tuple[str, str] | None]:
    """Return the poses by capture, and the first capture whose pose cannot be read, with the reason."""
    poses: dict[str, RigidTransform] = {}
    for capture in captures:
        if capture.pose is None and not stands_apart(cell, capture):
            return poses, (capture.id, "It has none.")
        try:
            poses[capture.id] = pose_of(cell, capture)
        except InputError as error:
            return poses, (capture.id, error.lack)
    return poses, None
