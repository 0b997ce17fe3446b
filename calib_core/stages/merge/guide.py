"""The steps of scanning and merging: from where the object must still be seen, then the merge, then its answer."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.captures.placement import Placement, placement_of
from calib_core.captures.scans import ScanGroup, poses_of, scan_groups
from calib_core.cell.axes import names_axes
from calib_core.cell.carriers import scanner_told
from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.messages import message, sentences
from calib_core.records import GuideNow, ResultsData, Session
from calib_core.stages.guide import GuideView
from calib_core.stages.reviewed import review
from calib_core.stages.turntable.guide import wants_turntable

WANTED_AROUND, LEAST_AROUND = 12, 6
WANTED_SIDES, LEAST_SIDES = 6, 2
_STEP_DEG = 360.0 / WANTED_AROUND
_DIFFERENT_DEG = 10.0  # views nearer to each other than this count once
_HEIGHTS_DEG = 15.0  # views from one height alone miss what they are too flat, or too steep, for
_EXIT = message(
    "{wanted_around} scans all around from at least two heights; {least_around} are the least. "
    "Neighbours should see a third of each other's surface.",
    wanted_around=WANTED_AROUND,
    least_around=LEAST_AROUND,
)
_EXIT_WITHOUT_TABLE = "Every side of the object that you need was seen, and each scan overlaps another."


@dataclass(frozen=True)
class _Views:
    """From where the object was scanned: one row a scan, angles in degrees.

    `azimuth_deg` goes around the table's axis in the table's own frame, `height_deg` above its plane; `table_deg`
    is what the encoder read.  Without a table azimuth and height are those of the base.
    """

    azimuth_deg: FloatArray
    height_deg: FloatArray
    table_deg: FloatArray
    direction: int


def guide(view: GuideView) -> GuideNow | None:
    """Return the instruction of scanning and merging; tool and table are known by then.

    It is None without a table as long as nothing was scanned: the calibration may be all that is wanted.
    """
    session, measured, data = view.session, view.measured, view.results
    if not wants_turntable(session) and not view.captures("scan"):
        return None
    merge = data.get("merge")
    if merge is not None and not merge.get("stale"):
        return review(
            merge,
            "Look at the merged object: its sections, its deviations, how far scans lie apart.",
            step="merge",
            exit_="You trust it: then save the cloud or the mesh.",
            drawings=("merge-done", "scan-around"),
        )
    refused = {m.capture for m in measured if m.verdict == "fail"}
    groups = scan_groups([capture for capture in view.captures("scan") if capture.id not in refused])
    placement = _placement(session, data)
    # Only of one turntable it is said where to turn it; of other axes, as of none, from where to look.
    turns = placement is not None and placement.base_from_turntable is not None and not names_axes(session.cell)
    if not groups:
        return _first(turns)
    assert placement is not None  # the caller has seen to it
    try:
        views = _views(session, groups, placement)
    except InputError as error:
        return _mend(error)
    return (_around if turns else _from_all_sides)(views, again=merge is not None)


def _placement(session: Session, data: ResultsData) -> Placement | None:
    """Return tool and table as they were solved last, or as the user brought them; None without a tool."""
    solved = [data[stage] for stage in ("chain", "turntable", "tcp") if stage in data]
    return placement_of(session.cell, [one for one in session.captures if one.step == "scan"], solved)


def _views(session: Session, groups: Sequence[ScanGroup], placement: Placement) -> _Views:
    """Return from where each scan looked; raises InputError where a pose or a table angle is of no use."""
    toward: list[FloatArray] = []
    read_deg: list[float] = []
    for group in groups:
        pairs = poses_of(session, group, placement)
        capture, pose = pairs[len(pairs) // 2]
        way = placement.way(capture, pose)
        out = 1.0 if scanner_told(session.cell, capture).z_axis == "toward" else -1.0
        toward.append(way.rotate([0.0, 0.0, out]))
        read_deg.append(capture.table_deg or 0.0)
    x, y, z = np.array(toward).T
    azimuth_deg, height_deg = np.rad2deg(np.arctan2(y, x)), np.rad2deg(np.arcsin(np.clip(z, -1, 1)))
    return _Views(azimuth_deg, height_deg, np.array(read_deg), placement.direction)


def _apart_deg(one: FloatArray, other: float) -> FloatArray:
    return np.abs((one - other + 180.0) % 360.0 - 180.0)


def _different(views: _Views) -> list[float]:
    """Return the azimuths that differ, in the order they came."""
    different: list[float] = []
    for azimuth in views.azimuth_deg.tolist():
        if not different or _apart_deg(np.array(different), azimuth).min() >= _DIFFERENT_DEG:
            different.append(azimuth)
    return different


def _around(views: _Views, *, again: bool) -> GuideNow:
    """Return what is missing all around the table."""
    taken = _different(views)
    if len(taken) < WANTED_AROUND:
        count = message("{count} of {wanted_around} scans around", count=len(taken), wanted_around=WANTED_AROUND)
        return _capture(
            message(
                "Turn the table to about {views:.0f}° and scan the object there.", views=_next_deg(views, taken)
            ),
            "What one scan cannot see, the next ones do. Change the scanner's height from scan to scan: low for "
            "the sides, steep for the top.",
            progress=count,
            still_needed=WANTED_AROUND - len(taken),
        )
    if np.ptp(views.height_deg) < _HEIGHTS_DEG:
        middle = float(np.median(views.height_deg))
        return _capture(
            message("Scan the object again from steeper above, at four angles of the table.")
            if middle < 50
            else message("Scan the object again from lower down, at four angles of the table."),
            message(
                "All scans look from about {middle:.0f}° above the table: what they see edge-on is missing.",
                middle=middle,
            ),
            progress="one height only",
            still_needed=4,
        )
    return _merge(len(views.azimuth_deg), again=again)


def _next_deg(views: _Views, taken: Sequence[float]) -> float:
    """Return the encoder's reading that brings the next free of twelve even azimuths before the scanner."""
    plan = [taken[0] - views.direction * k * _STEP_DEG for k in range(1, WANTED_AROUND)]
    free = [a for a in plan if _apart_deg(np.array(taken), a).min() > _STEP_DEG / 3]
    # As the table turns, the scanner goes round the object the other way.
    turns = [views.direction * (float(views.azimuth_deg[-1]) - a) for a in free] or [_STEP_DEG]
    ways = [(turn + 179.0) % 360.0 - 179.0 for turn in turns]  # half a turn counts as forwards
    nearest = min(ways, key=lambda way: (round(abs(way)), way < 0))
    return float((views.table_deg[-1] + nearest) % 360.0)


def _from_all_sides(views: _Views, *, again: bool) -> GuideNow:
    """Return what is missing of scans without a table: other directions."""
    a, h = np.deg2rad(views.azimuth_deg), np.deg2rad(views.height_deg)
    toward = np.stack([np.cos(a) * np.cos(h), np.sin(a) * np.cos(h), np.sin(h)], axis=1)
    apart = np.rad2deg(np.arccos(np.clip(toward @ toward.T, -1, 1)))
    sides = sum(not (apart[k, :k] < _DIFFERENT_DEG).any() for k in range(len(apart)))
    if sides < WANTED_SIDES:
        now = _capture(
            "Scan the object from another side.",
            "What one scan cannot see, the next ones do; each should see a third of another one's surface.",
            progress=message("{sides} of {wanted_sides} sides", sides=sides, wanted_sides=WANTED_SIDES),
            still_needed=WANTED_SIDES - sides,
        )
        least = message("{least} sides are the least.", least=LEAST_SIDES)
        enough = least if sides < LEAST_SIDES else "Merge whenever it is enough."
        return now.model_copy(update={"exit": sentences([_EXIT_WITHOUT_TABLE, enough])})
    return _merge(len(views.azimuth_deg), again=again)


def _first(turns: bool) -> GuideNow:
    if not turns:
        now = _capture(
            "Scan the object from its first side.",
            "The calibration puts every scan where it belongs: no markers and no registration are needed.",
            progress=message("{sides} of {wanted_sides} sides", sides=0, wanted_sides=WANTED_SIDES),
            still_needed=WANTED_SIDES,
        )
        return now.model_copy(update={"exit": _EXIT_WITHOUT_TABLE, "drawing": "scan-first"})
    now = _capture(
        "Put the object on the table and scan it.",
        "The cell is calibrated: export it under Result, and stop here; or go on and scan an object from "
        "everywhere, in one frame, without markers or registration.",
        progress=message("{count} of {wanted_around} scans around", count=0, wanted_around=WANTED_AROUND),
        still_needed=WANTED_AROUND,
    )
    return now.model_copy(update={"drawing": "scan-first"})


def _mend(error: InputError) -> GuideNow:
    now = _capture(
        message("Correct {place}: need {needed}.", place=error.where, needed=error.need),
        message("Got {found}. {advice}", found=error.got, advice=error.to_do),
        progress="a scan has no place",
        still_needed=1,
    )
    return now.model_copy(update={"exit": "Every scan has its pose and, where the table turned, its angle."})


def _capture(instruction: str, why: str, *, progress: str, still_needed: int) -> GuideNow:
    return GuideNow(
        step="scan",
        stage="merge",
        action="capture",
        instruction=instruction,
        why=why,
        exit=_EXIT,
        drawing="scan-around",
        progress=progress,
        still_needed=still_needed,
    )


def _merge(count: int, *, again: bool) -> GuideNow:
    return GuideNow(
        step="merge",
        stage="merge",
        action="solve",
        instruction="Merge again: captures have changed."
        if again
        else message("Merge the {count} scans.", count=count),
        why="Each scan is cleaned and goes where robot, table and calibration put it. How far overlapping scans "
        "lie apart then shows how good all of it is.",
        exit="Overlapping scans lie as near to each other as the calibration predicts.",
        drawing="merge-solve",
        progress="enough scans",
    )
