"""The camera's and the laser plane's steps: what the boards cover already, and what is still missing."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from calib_core.messages import message, templates
from calib_core.optics.coverage_cells import ENOUGH_COVERED
from calib_core.records import Board, GuideNow, Measured
from calib_core.stages.boards_seen import boards_seen, seen_cells, usable
from calib_core.stages.guide import GuideView
from calib_core.stages.reviewed import review

WANTED_VIEWS, WANTED_STRIPES = 10, 8
_ENOUGH_VIEWS = 14  # so many do, even where a part of the image stays empty: the result tells how that counts
_COLUMNS, _ROWS = 3, 3  # the parts of the image that the next view is asked for by
_TILTED = message("Show the board tilted another way, by 20 to 40°.")
_TILTED_RAD = math.radians(10.0)  # less is no view of that side
_SIDES: Final = templates({
    (-1, 0): "Turn the board to face the image's left edge, by 20 to 40°: no view shows it so yet.",
    (1, 0): "Turn the board to face the image's right edge, by 20 to 40°: no view shows it so yet.",
    (0, -1): "Tilt the board to face the image's upper edge, by 20 to 40°: no view shows it so yet.",
    (0, 1): "Tilt the board to face the image's lower edge, by 20 to 40°: no view shows it so yet.",
})  # fmt: skip
_PLACES = (
    "upper left", "top", "upper right", "left", "middle", "right", "lower left", "bottom", "lower right",
)  # fmt: skip
_LOOSE_BOARD = templates(
    (
        "Take the board and its stripe again, with the board near the scanner.",
        "Take the board and its stripe again, with the board far from the scanner.",
        "Take the board and its stripe again, with the board tilted to the left.",
        "Take the board and its stripe again, with the board tilted to the right.",
    )
)
_FIXED_BOARD = templates(
    (
        "Move the robot so that the fixed board is near the scanner, and take it with the stripe on it.",
        "Move the robot so that the fixed board is far from the scanner, and take it with the stripe on it.",
        "Move the robot so that the fixed board is seen tilted to the left, and take it with the stripe on it.",
        "Move the robot so that the fixed board is seen tilted to the right, and take it with the stripe on it.",
    )
)


def guide(view: GuideView) -> GuideNow | None:
    """Return the instruction of the camera's step.

    Stripes on boards count for the camera too: where it is stale while they are taken, it waits for all of them.
    """
    status, session, measured = view.statuses["camera"], view.session, view.measured
    result = view.results.get("camera")
    if status == "known" or (status == "stale" and _stripes_are_under_way(view)):
        return None
    if session.cell.board is None:
        return _board_missing("camera")
    if result is not None and not result.get("stale"):
        return _review("camera", result, "Look at the result: the model, the arrows of each view, the coverage.")
    views = usable(session, measured, "camera")
    needed = max(WANTED_VIEWS - len(views), 0)
    missing = next_view(views)
    if not needed and (missing is None or len(views) >= _ENOUGH_VIEWS):
        return _solve("camera", "Solve the camera.", "Views all over the image determine the lens.", result)
    return _now(
        "camera",
        action="capture",
        instruction=missing or _TILTED,
        why="The lens is known only where boards were seen; tilts and distances fix the focal length.",
        exit=message(
            "{wanted_views} sharp views: all parts of the image, near and far, tilted to all sides.",
            wanted_views=WANTED_VIEWS,
        ),
        drawing="board-views",
        progress=message("{count} of {wanted_views} views", count=len(views), wanted_views=WANTED_VIEWS),
        still_needed=max(needed, 1),
    )


def laser_plane_now(view: GuideView) -> GuideNow | None:
    """Return the instruction of the laser plane's step."""
    session, measured, result = view.session, view.measured, view.results.get("laser-plane")
    if view.statuses["laser-plane"] == "known":
        return None
    if session.cell.board is None:
        return _board_missing("laser-plane")
    if result is not None and not result.get("stale"):
        return _review("laser-plane", result, "Look at the result: the plane, and how each stripe lies on it.")
    stripes = usable(session, measured, "laser-plane")
    needed = max(WANTED_STRIPES - len(stripes), 0)
    if not needed:
        return _solve("laser-plane", "Solve the laser plane.", "Stripes near and far determine the plane.", result)
    first, again = _stripe_words(session.cell.board, len(stripes))
    return _now(
        "laser-plane",
        action="capture",
        instruction=again if stripes else first,
        why="Each stripe is one line of the plane: lines at different distances and tilts fix it.",
        exit=message(
            "{wanted_stripes} boards with the stripe, over all distances in use, tilted differently.",
            wanted_stripes=WANTED_STRIPES,
        ),
        drawing="board-stripe",
        progress=message("{count} of {wanted_stripes} stripes", count=len(stripes), wanted_stripes=WANTED_STRIPES),
        still_needed=needed,
    )


def _stripes_are_under_way(view: GuideView) -> bool:
    """Whether more stripes on boards are asked for, and some are there."""
    now = laser_plane_now(view)
    return now is not None and now.action == "capture" and bool(view.captures("laser-plane"))


def _stripe_words(board: Board, stripes: int) -> tuple[str, str]:
    """Return what to do for the first board with the stripe, and for the next one."""
    first = "Lay the stripe on the board; take the lit board and the stripe without moving it."
    return first, (_FIXED_BOARD if board.fixed else _LOOSE_BOARD)[stripes % 4]


def next_view(views: Sequence[Measured]) -> str | None:
    """Return where the board should go next, None where the image is covered and distances and tilts differ."""
    told = boards_seen("camera", [view for view in views if view.image_size])
    if told is None:
        return "Show the board to the camera, large and sharp in the middle of the image." if not views else None
    if told.covered < ENOUGH_COVERED:
        seen = seen_cells(views)
        parts = [part.mean() for rows in np.array_split(seen, _ROWS) for part in np.array_split(rows, _COLUMNS, 1)]
        return message(
            "Show the board at the {places} of the image: least was seen there yet.",
            places=_PLACES[int(np.argmin(parts))],
        )
    if told.one_distance:
        return "Show the board nearer to the camera, then farther away: all views are from one distance."
    if not any(view.pixel_from_board for view in views):
        return None  # measured by a version that did not say how boards lie
    facing = np.array([one.facing_rad for one in told.facing]).reshape(-1, 2)
    if not len(facing):
        return _TILTED
    least = min(_SIDES, key=lambda side: float((facing @ side).max()))
    return None if (facing @ least).max() > _TILTED_RAD else _SIDES[least]


def _board_missing(step: str) -> GuideNow:
    return _now(
        step,
        action="capture",
        instruction="Describe the calibration board in the cell: its kind, columns, rows and pitch.",
        why="Its pattern is the measure that the camera is calibrated by.",
        exit="The cell has a board.",
        drawing="board-views",
        still_needed=1,
    )


def _solve(step: str, instruction: str, why: str, result: Mapping[str, Any] | None) -> GuideNow:
    return _now(
        step,
        action="solve",
        instruction=instruction if result is None else "Solve again: the captures have changed.",
        why=why,
        exit="The residuals are small and have no pattern, and every view counts.",
        drawing="board-solve",
        progress="enough captures",
    )


def _review(step: str, result: Mapping[str, Any], look: str) -> GuideNow:
    return review(result, look, step=step, exit_="You trust it.", drawings=("board-solve", "board-solve"))


def _now(step: str, **fields: Any) -> GuideNow:
    return GuideNow.model_validate({"step": step, "stage": step, **fields})
