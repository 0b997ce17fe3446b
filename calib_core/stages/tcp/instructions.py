"""What the TCP step asks for: each instruction with its reason, its end and its drawing."""

import numpy as np

from calib_core.cell.carriers import ball_on_flange
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.advice import Advice
from calib_core.messages import Names, message, plural, sentences
from calib_core.records import Cell, GuideNow
from calib_core.stages.reviewed import suggested
from calib_core.stages.tcp.motion import (
    GOOD_TURNS,
    LEAST_SHIFTS,
    LEAST_TURNS,
    WANTED_SHIFTS,
    WANTED_TURNS,
    Motion,
    next_shift,
    next_turn,
    turn_between_deg,
)

_SHIFTS = {
    (False, False): message("Shift the scanner 30–80 mm in a new direction. Keep its orientation."),
    (False, True): message(
        "Shift the scanner 30–80 mm in another direction: all shifts so far are parallel. Keep its orientation."
    ),
    (True, False): message("Shift the ball with the flange 30–80 mm in a new direction. Keep its orientation."),
    (True, True): message(
        "Shift the ball with the flange 30–80 mm in another direction: all shifts so far are parallel. "
        "Keep its orientation."
    ),
}
"""What is asked for, by whether the flange carries the ball, and whether the shifts so far are parallel."""
SOLVE = message("Solve the TCP.")


def solve_of_few_axes(*, again: bool) -> GuideNow:
    """Return the solve of many captures that are not turned about two axes, as of a machine that cannot tilt."""
    why = message(
        "No captures differ by turns about two axes. If the machine can tilt the flange, capture such poses "
        "first; if it cannot, all else is solved."
    )
    return solve(GOOD_TURNS, again=again).model_copy(update={"why": why})


def contradicted(advice: Advice) -> GuideNow:
    """Return the solve of captures that do not agree with each other: it says why, and what mends it."""
    if advice.contradicted:
        instruction = message("The captures contradict each other. Solve the TCP: the result says what is wrong.")
        progress = message("the captures contradict each other")
    else:
        instruction = plural(
            "{apart} contradicts the other captures. Solve the TCP: the result says what is wrong.",
            "{apart} contradict the other captures. Solve the TCP: the result says what is wrong.",
            by="apart",
            apart=Names(advice.apart),
        )
        progress = plural(
            "{count} capture contradicts the others",
            "{count} captures contradict the others",
            by="count",
            count=len(advice.apart),
        )
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="solve",
        instruction=instruction,
        why="No place of scanner and sphere explains all captures: poses in another order, another convention or "
        "unit, or a sphere that was moved. More captures do not help before that is mended.",
        exit="Every capture fits the sphere within its noise, and no direction is left open.",
        drawing="tcp-solve",
        progress=progress,
    )


def mend_pose(unread: tuple[str, str]) -> GuideNow:
    """Ask for the pose of a capture whose pose cannot be read."""
    capture, reason = unread
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="capture",
        instruction=message("Give the robot's pose of {capture}.", capture=capture),
        why=message(
            "{reason} A capture says something about the TCP only together with the flange's pose.", reason=reason
        ),
        exit="Every capture has a pose that can be read.",
        drawing="tcp-first",
        still_needed=1,
    )


def first(cell: Cell) -> GuideNow:
    """Ask for the first capture."""
    seen = {
        "cloud": "Bring the whole near side of the sphere into view",
        "center": "Bring the sphere into view",
    }.get(str(cell.scanner.kind), "Lay the stripe over the sphere, a little beside its middle")
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="capture",
        instruction=message("{seen}, and take the first capture.", seen=seen),
        why="The sphere stands still from now on: every capture sees the same point from another pose."
        if not ball_on_flange(cell)
        else "The scanner stands still, and the ball keeps its place on the flange: each pose shows it anew.",
        exit="The sphere is found. For a stripe: r/R between 0.45 and 0.95, 70° of arc or more.",
        drawing="tcp-first",
        progress=message("0 of {wanted_shifts} captures", wanted_shifts=1 + WANTED_SHIFTS + WANTED_TURNS),
        still_needed=1 + WANTED_SHIFTS + WANTED_TURNS,
    )


def shift(cell: Cell, motion: Motion, home: RigidTransform) -> GuideNow:
    """Ask for a capture with the flange shifted."""
    count = len(motion.shifts_mm)
    length_mm = float(np.clip((cell.sphere_diameter_mm or 60.0) / 2, 30.0, 60.0))
    pose = next_shift(motion, home, length_mm)
    parallel = count >= LEAST_SHIFTS and not motion.shifts_differ
    on_flange = ball_on_flange(cell)
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="capture",
        instruction=_SHIFTS[on_flange, parallel],
        why="Two shifts that are not parallel fix the scanner's rotation in base; a third makes it sure."
        if on_flange
        else "Two shifts that are not parallel fix the scanner's rotation on the flange; a third makes it sure.",
        exit=message(
            "{wanted_shifts} shifts with one orientation, not all parallel; {least_shifts} are the least.",
            wanted_shifts=WANTED_SHIFTS,
            least_shifts=LEAST_SHIFTS,
        ),
        drawing="tcp-shift",
        progress=message("{count} of {wanted_shifts} shifts", count=count, wanted_shifts=WANTED_SHIFTS),
        still_needed=max(WANTED_SHIFTS - count, 1),
        **suggested(
            cell, pose, "If the sphere leaves the view here, go less far, or the same way in the other direction."
        ),
    )


def turn(cell: Cell, motion: Motion, home: RigidTransform, sphere: tuple[FloatArray | None, str]) -> GuideNow:
    """Ask for a capture with the flange turned, best about the sphere, with a note of what that rests on."""
    count = len(motion.turns_rad)
    center_in_base_mm, note = sphere
    pose = next_turn(motion, home, center_in_base_mm)
    angle_deg, axis = turn_between_deg(home, pose)
    parallel = count >= LEAST_TURNS and not motion.turns_differ
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="capture",
        instruction=(
            message(
                "All turns so far are about one axis: turn the flange by about {angle_deg:.0f}°, mostly about "
                "its {axis} axis, and bring the sphere back into view.",
                angle_deg=angle_deg,
                axis=axis,
            )
            if parallel
            else message(
                "Turn the flange by about {angle_deg:.0f}°, mostly about its {axis} axis, and bring the sphere "
                "back into view.",
                angle_deg=angle_deg,
                axis=axis,
            )
        ),
        why="Turns about different axes fix where the ball sits on the flange."
        if ball_on_flange(cell)
        else "Turns about different axes fix where the scanner sits on the flange.",
        exit=message(
            "{wanted_turns} orientations that differ by 5° or more, about axes that are not "
            "parallel; {least_turns} are the least, {good_turns} are good.",
            wanted_turns=WANTED_TURNS,
            least_turns=LEAST_TURNS,
            good_turns=GOOD_TURNS,
        ),
        drawing="tcp-turn",
        progress=message("{count} of {wanted_turns} turns", count=count, wanted_turns=WANTED_TURNS),
        still_needed=max(WANTED_TURNS - count, 1),
        **suggested(cell, pose, note),
    )


def solve(turns: int, *, again: bool) -> GuideNow:
    """Ask for the solve."""
    more = message("{count} more turns would narrow the answer.", count=GOOD_TURNS - turns)
    return GuideNow(
        step="tcp",
        stage="tcp",
        action="solve",
        instruction="Solve again: the captures have changed." if again else SOLVE,
        why=sentences(["The shifts and turns determine all of it.", more if turns < GOOD_TURNS else ""]),
        exit="Every capture fits the sphere within its noise, and no direction is left open.",
        drawing="tcp-solve",
        progress="enough captures",
    )
