"""The verification's step: captures of the sphere that were not used for the answer, then how far they scatter."""

from calib_core.cell.carriers import ball_on_flange
from calib_core.guidance.advice import verify_pose
from calib_core.messages import message
from calib_core.records import GuideNow
from calib_core.stages.guide import GuideView
from calib_core.stages.reviewed import review, suggested
from calib_core.stages.turntable.guide import wants_turntable
from calib_core.steps import tool_stages

WANTED_CAPTURES = 10
WANTED_OF_PLATE = 8
_NOTE = "No capture of the calibration was taken from here, and none tells more of the tool by itself."
_PLATE_EXIT = message(
    "{wanted_of_plate} captures of the plate, at different places and turned to all sides.",
    wanted_of_plate=WANTED_OF_PLATE,
)
_EXIT = message(
    "{wanted_captures} captures of the sphere, standing still, from all sides.", wanted_captures=WANTED_CAPTURES
)
_EXIT_ON_FLANGE = message(
    "{wanted_captures} captures of the sphere on the flange, turned to all sides.", wanted_captures=WANTED_CAPTURES
)


def guide(view: GuideView) -> GuideNow | None:
    """Return the instruction of the verification.

    It is None where nobody began it, but where limits were set for it and the answer is there, and where the tool
    was given with the cell and nothing else is left to do: then only captures of its own show how good it is here.
    """
    captures = view.captures("verify")
    given = view.statuses["tcp"] == "known"
    limits = view.session.cell.verification
    limited = any(value is not None for value in limits.model_dump().values())
    asked = limited and any(view.fresh(stage) is not None for stage in tool_stages())
    alone = given and not wants_turntable(view.session) and not view.captures("scan")
    if not captures and not asked and not alone:
        return None
    result = view.results.get("verify")
    fresh = view.fresh("verify")
    if fresh is not None:
        look = "Look at the result: how far held-out captures scatter, and what was expected."
        return review(fresh, look, step="verify", exit_="You trust it: then export the answer.")
    refused = {m.capture for m in view.measured if m.verdict == "fail"}
    carried = ball_on_flange(view.session.cell)
    of_plate = sum(capture.id not in refused for capture in view.captures("plate"))
    flat = limits.flatness_mm is not None or limits.flatness_95_mm is not None
    if of_plate and flat and not captures:  # a plate alone, as somebody began
        return _plate(of_plate, carried) if of_plate < WANTED_OF_PLATE else _solve(again=result is not None)
    seen = sum(capture.id not in refused for capture in captures)
    if seen >= WANTED_CAPTURES:
        if flat and of_plate < WANTED_OF_PLATE:
            return _plate(of_plate, carried)
        return _solve(again=result is not None)
    pose = verify_pose(view.session, view.measured, view.results)
    told = {} if pose is None else suggested(view.session.cell, pose.base_from_tool0, _NOTE)
    return GuideNow(
        step="verify",
        stage="verify",
        action="capture",
        instruction="Take captures of the sphere from poses that were not used for the TCP."
        if pose is None
        else "Move the flange to the pose below, away from those of the TCP, and capture the sphere.",
        why="The TCP was given with the cell; only captures of its own show how good it is here."
        if given
        else "Captures that the answer has never seen show how good it is.",
        exit=_EXIT_ON_FLANGE if carried else _EXIT,
        drawing="ball-first" if carried else "tcp-first",
        progress=message("{seen} of {enough} captures", seen=seen, enough=WANTED_CAPTURES),
        still_needed=WANTED_CAPTURES - seen,
        **told,
    )


def _plate(seen: int, on_flange: bool) -> GuideNow:
    return GuideNow(
        step="plate",
        stage="verify",
        action="capture",
        instruction="Fix a flat plate to the flange, and capture it from several sides with nothing else in view."
        if on_flange
        else "Fix a flat plate where the workpiece stands, and capture it with nothing else in view.",
        why="A limit is set for the flatness: seen from several sides a plate is flat only with a right tool.",
        exit=_PLATE_EXIT,
        drawing="scan-first",
        progress=message(
            "{seen} of {wanted_of_plate} captures of the plate", seen=seen, wanted_of_plate=WANTED_OF_PLATE
        ),
        still_needed=WANTED_OF_PLATE - seen,
    )


def _solve(*, again: bool) -> GuideNow:
    return GuideNow(
        step="verify",
        stage="verify",
        action="solve",
        instruction="Verify again: the captures have changed." if again else "Verify the answer.",
        why="How far the sphere scatters over poses that were not used says what to expect of the next ones.",
        exit="The scatter is what the uncertainties predict.",
        drawing="tcp-solve",
        progress="enough captures",
    )
