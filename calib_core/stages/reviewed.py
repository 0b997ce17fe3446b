"""What to do with a result that is up to date, and how a proposed pose is told: of every stage's guide."""

from collections.abc import Mapping
from typing import Any

from calib_core.findings import has_code, message_of_finding, sentence_of, to_do_of
from calib_core.findings.codes.arm import LAG_NOT_CHECKED
from calib_core.frames import RigidTransform
from calib_core.messages import Names, message, plural, sentences
from calib_core.poses.numbers import to_pose
from calib_core.records import Cell, Finding, GuideNow

OF_BALL = {
    "tcp-first": "ball-first",
    "tcp-shift": "ball-shift",
    "tcp-turn": "ball-turn",
    "tcp-solve": "ball-turn",
    "tcp-done": "ball-done",
}
"""Drawings of a ball that the flange carries."""
ASK_FOR_REPEAT = (
    "Nothing shows a lag that is always in one direction yet: drive to an earlier pose again from the other side, "
    "let the arm come to rest, and capture the sphere once more."
)


def review(
    result: Mapping[str, Any],
    look: str = "Look at the result: its uncertainty, the residuals, the two steps beside the joint answer.",
    *,
    step: str = "tcp",
    stage: str | None = None,
    exit_: str = "You trust it: then export it, or verify it with captures that were not used.",
    drawings: tuple[str, str] = ("tcp-done", "tcp-turn"),
) -> GuideNow:
    """Return what to do with a result that is up to date.

    Parameters
    ----------
    result : mapping
        As JSON data.
    look : str
        What is said of a good one.
    step, stage, exit_ : str
        As in `GuideNow`; a stage that bears its step's name is left out.
    drawings : tuple of str
        Of an accepted result, and of another one.
    """
    rejected = [r["capture"] for r in result.get("residuals", []) if not r.get("used", True)]
    undetermined = [u["description"] for u in result.get("undetermined", [])]
    shown = [Finding.model_validate(one) for one in result.get("findings") or []]
    told = [_said(one) for one in shown if one.severity != "note" and one.behind is None]
    doubts = [*undetermined, *(told or result.get("warnings", []))]
    action, progress = "review", message("solved, to be looked at")
    if undetermined:
        instruction = message(
            "Take another capture. Still open: {undetermined}", undetermined=as_sentence(undetermined[0])
        )
        why = "Without it the answer is not determined in this direction."
        action, progress = "capture", message("{count} still open", count=len(undetermined))
    elif result.get("verdict") == "fail":
        instruction = "Do not use this result yet: fix what is named below, then solve again."
        why = as_sentence(doubts[0]) if doubts else "It does not explain the captures within their noise."
    elif rejected:
        instruction = plural(
            "Look at the result, and at why {rejected} was left out.",
            "Look at the result, and at why {rejected} were left out.",
            by="rejected",
            rejected=Names(rejected),
        )
        why = "A capture that contradicts all others was spoiled: the sphere moved, or the pose is not its own."
    else:
        instruction = look
        why = as_sentence(doubts[0]) if doubts else "An answer is as good as its evidence."
        if has_code(result, LAG_NOT_CHECKED):
            why = sentences([why, ASK_FOR_REPEAT])
    return GuideNow(
        step=step,
        stage=stage or step,
        action=action,
        instruction=instruction,
        why=why,
        exit=exit_,
        drawing=drawings[0] if result.get("verdict") == "pass" and not undetermined else drawings[1],
        progress=progress,
        still_needed=1 if undetermined else 0,
    )


def suggested(cell: Cell, pose: RigidTransform, note: str) -> dict[str, Any]:
    """Return a proposed pose as the guide's fields."""
    numbers = to_pose(cell.pose_convention, pose)
    return {
        "suggested_pose": pose.to_rows(),
        "suggested_pose_numbers": [round(v, 6) for v in numbers],
        "suggested_note": note,
    }


def _said(finding: Finding) -> str:
    """Return what a stored finding says and what to do, in any language where its code is known."""
    try:
        return sentences([message_of_finding(finding), to_do_of(finding)])
    except (KeyError, ValueError):  # another version's code, or its values
        return sentence_of(finding)


def as_sentence(text: str) -> str:
    """Return a text that ends as a sentence does."""
    return text if text.endswith((".", "!", "?")) else message("{text}.", text=text)
