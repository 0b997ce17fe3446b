"""The turntable's step: which angles and heights are still needed, then the table, then the whole chain."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.cell.axes import moves_object, names_axes
from calib_core.cell.carriers import stands_apart
from calib_core.cell.consistency import without_readings
from calib_core.cell.found import known_scanner
from calib_core.errors import InputError
from calib_core.findings import has_code
from calib_core.findings.codes.turntable import PLAY_NOT_CHECKED
from calib_core.guidance.advice import amount
from calib_core.guidance.table_advice import TableAdvice, TableShot, table_advice
from calib_core.messages import message, sentences
from calib_core.records import Capture, Cell, GuideNow, Meter, Session
from calib_core.stages.guide import GuideView
from calib_core.stages.reviewed import review, suggested
from calib_core.stages.turntable.play import ASK_FOR_PLAY

WANTED_ANGLES, LEAST_ANGLES = 8, 3
WANTED_MOUNTS = 2
_DIFFERENT_DEG = 5.0  # angles nearer to each other than this count once
_TWO_TURNS = 2 * np.pi + 0.01
_EXIT = message(
    "{wanted_angles} angles at each of {wanted_mounts} heights; {least_angles} angles are the least, "
    "spread as far as the table turns.",
    wanted_angles=WANTED_ANGLES,
    wanted_mounts=WANTED_MOUNTS,
    least_angles=LEAST_ANGLES,
)


def wants_turntable(session: Session) -> bool:
    """Whether the cell tells of a turntable or of axes like it, or captures of one are there already."""
    if session.cell.known.base_from_turntable is not None:
        return False
    return "turntable" in session.cell.model_fields_set or moves_object(session.cell) or bool(_captures(session))


def guide(view: GuideView) -> GuideNow | None:
    """Return the instruction of the turntable's step, None where there is no table; the TCP is known by then."""
    session, measured, data = view.session, view.measured, view.results
    if not wants_turntable(session):
        return None
    captures = _captures(session)
    fault = _fault(session, captures)
    if fault is not None:
        return _mend(*fault)
    table, chain = _for_parts(data.get("turntable")), _for_parts(data.get("chain"))
    if chain is not None and not chain.get("stale"):
        return _reviewed(session.cell, _review(chain), table_advice(session, measured, data))
    if table is not None and not table.get("stale"):
        if table.get("verdict") == "fail" or table.get("undetermined") or not _has_tcp(session):
            return _review(table)
        return _solve_chain(again=chain is not None)
    advice = table_advice(session, measured, data)
    if advice is not None and session.cell.wanted_mm is not None:
        return _by_worth(session.cell, advice, again=table is not None)
    refused = {m.capture for m in measured if m.verdict == "fail"}
    angles = _angles_by_mount([c for c in captures if c.id not in refused])
    if names_axes(session.cell):
        count = min((len(taken) for taken in angles.values()), default=0)
        return _next_readings(count) if count < WANTED_ANGLES else _solve_table(again=table is not None)
    if not angles:
        return _first()
    mount, taken = next(
        ((m, a) for m, a in angles.items() if len(a) < WANTED_ANGLES),
        (next(reversed(angles)), next(reversed(angles.values()))),
    )
    if len(taken) < WANTED_ANGLES:
        return _with_advice(session.cell, _next_angle(mount, taken, angles), mount, advice)
    if len(angles) < WANTED_MOUNTS:
        return _next_height(mount, angles)
    return _solve_table(again=table is not None)


def _for_parts(result: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Return a result without what it leaves open, where a part on the table does not feel it."""
    return result and ({**result, "undetermined": []} if result.get("up_to_shift") else result)


def _by_worth(cell: Cell, advice: TableAdvice, *, again: bool) -> GuideNow:
    """Return the capture that takes most off the uncertainty at the workpiece; enough of them: the solve."""
    meter, shot = advice.meter, advice.next
    if meter.enough or shot is None:
        words = "enough" if meter.enough else "no pose is left that the limits allow"
        progress = f"{words}: {_words(meter)}"
        return _solve_table(again=again).model_copy(update={"progress": progress, "meter": meter})
    more, progress = meter.still_needed, _words(meter)
    if more is not None:
        progress = message("{progress}, about {count} more", progress=progress, count=more)
    return _now(
        action="capture",
        instruction=_to_do(shot),
        why=_why(shot, meter),
        exit=message("{wanted_mm} at the workpiece, as wanted.", wanted_mm=amount(meter.wanted_mm)),
        drawing="turntable-turn" if shot.higher_mm is None else "turntable-height",
        progress=progress,
        still_needed=more or 1,
        meter=meter,
        **_suggested(cell, shot),
    )


def _with_advice(cell: Cell, now: GuideNow, mount: str, advice: TableAdvice | None) -> GuideNow:
    """Return the instruction by the plan of even angles with the angle that tells most, where that is known."""
    if advice is None or advice.next is None or advice.next.higher_mm is not None or advice.next.mount != mount:
        return now if advice is None else now.model_copy(update={"meter": advice.meter})
    told = {"instruction": _to_do(advice.next), "why": _why(advice.next, advice.meter), "meter": advice.meter}
    return now.model_copy(update={**told, **_suggested(cell, advice.next)})


def _reviewed(cell: Cell, now: GuideNow, advice: TableAdvice | None) -> GuideNow:
    """Return the look at the whole chain's result; where more is wanted, the capture that helps most."""
    if advice is None or advice.meter.wanted_mm is None or now.action != "review":
        return now
    if advice.meter.enough:
        return now.model_copy(
            update={"meter": advice.meter, "progress": message("enough: {advice}", advice=_words(advice.meter))}
        )
    if advice.next is None or advice.meter.still_needed is None:
        return now.model_copy(update={"meter": advice.meter})
    return _by_worth(cell, advice, again=False).model_copy(update={"stage": now.stage})


def _turn_to(table_deg: float) -> str:
    return message("Turn the table to about {angle} and capture the sphere there.", angle=f"{table_deg:.0f}°")


def _to_do(shot: TableShot) -> str:
    if shot.higher_mm is None:
        return _turn_to(shot.table_deg)
    by = {"higher_mm": abs(shot.higher_mm), "angle": f"{shot.table_deg:.0f}°"}
    if shot.higher_mm > 0:
        return message(
            "Fix the sphere about {higher_mm:.0f} mm higher, name that mount, turn the table to about {angle} and "
            "capture it.",
            **by,
        )
    return message(
        "Fix the sphere about {higher_mm:.0f} mm lower, name that mount, turn the table to about {angle} and "
        "capture it.",
        **by,
    )


def _why(shot: TableShot, meter: Meter) -> str:
    gain = message(
        "at the workpiece on the table from {uncertainty_mm} to {after_next_mm}",
        uncertainty_mm=amount(meter.uncertainty_mm),
        after_next_mm=amount(meter.after_next_mm),
    )
    if shot.higher_mm is not None:
        return message("Three captures there tell more than three more here: {gain}.", gain=gain)
    return message("No other angle tells more: {gain}.", gain=gain)


def _words(meter: Meter) -> str:
    now = amount(meter.uncertainty_mm)
    return (
        now
        if meter.wanted_mm is None
        else message("{now}, wanted {wanted_mm}", now=now, wanted_mm=amount(meter.wanted_mm))
    )


def _suggested(cell: Cell, shot: TableShot) -> dict[str, Any]:
    note = "The scanner looks at where the sphere will be once the table has turned: turn it first."
    return {**suggested(cell, shot.pose, note), "suggested_table_deg": shot.table_deg}


def _captures(session: Session) -> list[Capture]:
    return [c for c in session.captures if c.step == "turntable" and not c.excluded]


def _has_tcp(session: Session) -> bool:
    """Whether there is a chain to solve: a tool that comes from captures, not one that was given."""
    return known_scanner(session.cell) is None and any(c.step == "tcp" for c in session.captures)


def _angles_by_mount(captures: Sequence[Capture]) -> dict[str, list[float]]:
    """Return the different table angles in degrees, from 0 to 360, by mounting, both in the order they came."""
    angles: dict[str, list[float]] = {}
    for capture in captures:
        taken = angles.setdefault(capture.mount or "", [])
        # An angle that nobody read is taken to be a new one: the solver finds out.
        angle = (45.0 * len(taken) if capture.table_deg is None else float(capture.table_deg)) % 360.0
        if all(_apart_deg(angle, other) >= _DIFFERENT_DEG for other in taken):
            taken.append(angle)
    return angles


def _apart_deg(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)


def _fault(session: Session, captures: Sequence[Capture]) -> tuple[str, str, str] | None:
    """Return what must be mended first: the capture, what is missing in it, and why."""
    for capture, axis in without_readings(session.cell, captures):
        why = message("The axis moves the sphere: without its reading the capture says nothing of where it stood.")
        return capture.id, message("reading of the axis '{axis}'", axis=axis), why
    turned = not names_axes(session.cell)
    for capture in captures:
        if turned and capture.table_deg is None and session.cell.turntable.angles != "unknown":
            why = (
                "The sphere goes round with the table: without its angle the capture says nothing about the axis."
            )
            return capture.id, "table's angle", why
        if capture.pose is None and not stands_apart(session.cell, capture):
            return (
                capture.id,
                "robot's pose",
                "Where the scanner saw the sphere from is told by the flange's pose.",
            )
        try:
            pose_of(session.cell, capture)
        except InputError as error:
            return capture.id, "robot's pose", error.lack
    read = [abs(capture.table_deg or 0.0) for capture in captures]
    if len(captures) >= LEAST_ANGLES and 0 < max(read) <= _TWO_TURNS and any(v % 1 for v in read):
        why = message(
            "No angle is above {most:.2f}: these look like radians, and degrees are meant.", most=max(read)
        )
        return captures[-1].id, "table's angle in degrees", why
    return None


def _mend(capture: str, missing: str, why: str) -> GuideNow:
    return _now(
        action="capture",
        instruction=message("Give the {missing} of {capture}.", missing=missing, capture=capture),
        why=why,
        exit="Every capture has its reading and its pose.",
        drawing="turntable-first",
        still_needed=1,
    )


def _next_readings(count: int) -> GuideNow:
    return _now(
        action="capture",
        instruction="Move one axis at a time between captures of the sphere on it, then all together.",
        why="Where the sphere is at different readings of an axis tells how the axis moves it.",
        exit=message("{wanted_angles} captures of each sphere on an axis.", wanted_angles=WANTED_ANGLES),
        drawing="turntable-turn",
        progress=message("{count} of {wanted_angles} captures", count=count, wanted_angles=WANTED_ANGLES),
        still_needed=WANTED_ANGLES - count,
    )


def _first() -> GuideNow:
    return _now(
        action="capture",
        instruction="Fix the sphere on the table, well off its axis, and capture it.",
        why="As the table turns, the sphere's centre goes round on a circle about the axis.",
        exit=_EXIT,
        drawing="turntable-first",
        progress=message("0 of {wanted_angles} angles, first height", wanted_angles=WANTED_ANGLES),
        still_needed=WANTED_ANGLES * WANTED_MOUNTS,
    )


def _next_angle(mount: str, taken: Sequence[float], angles: Mapping[str, Sequence[float]]) -> GuideNow:
    heights = max(WANTED_MOUNTS - len(angles), 0)
    return _now(
        action="capture",
        instruction=_turn_to(_suggested_deg(taken)),
        why="Angles all around fix the circle and show the table's wobble. "
        "Where the table or the view ends earlier, spread the angles over what there is.",
        exit=_EXIT,
        drawing="turntable-turn",
        progress=message(
            "{count} of {wanted_angles} angles at height {height}",
            count=len(taken),
            wanted_angles=WANTED_ANGLES,
            height=f"'{mount}'" if mount else len(angles),
        ),
        still_needed=WANTED_ANGLES - len(taken) + heights * WANTED_ANGLES,
    )


def _suggested_deg(taken: Sequence[float]) -> float:
    """Return the next free angle of eight even steps from the first one; or the widest gap's middle."""
    step = 360.0 / WANTED_ANGLES
    plan = [(taken[0] + k * step) % 360.0 for k in range(1, WANTED_ANGLES)]
    last = taken[-1]
    free = [a for a in plan if all(_apart_deg(a, other) > step / 3 for other in taken)]
    if free:
        return min(free, key=lambda a: (a - last) % 360.0)
    ordered = np.sort(np.asarray(taken))
    gaps = np.diff(np.append(ordered, ordered[0] + 360.0))
    widest = int(np.argmax(gaps))
    return float((ordered[widest] + gaps[widest] / 2) % 360.0)


def _next_height(mount: str, angles: Mapping[str, Sequence[float]]) -> GuideNow:
    return _now(
        action="capture",
        instruction="Fix the sphere at another height, name that mount, and capture it at 8 angles again.",
        why="One circle alone leaves the axis's direction weak; the line through two circles' centres fixes it. "
        "Heights 100 mm or more apart are good.",
        exit=_EXIT,
        drawing="turntable-height",
        progress=message(
            "{count} of {wanted_mounts} heights, '{mount}' done"
            if mount
            else "{count} of {wanted_mounts} heights",
            count=len(angles),
            wanted_mounts=WANTED_MOUNTS,
            mount=mount,
        ),
        still_needed=WANTED_ANGLES,
    )


def _solve_table(*, again: bool) -> GuideNow:
    return _now(
        stage="turntable",
        action="solve",
        instruction="Solve again: the captures have changed." if again else "Solve where the axis is.",
        why="Where the ball went determines the axis and where it stands.",
        exit="Every capture lies on its way within its noise.",
        drawing="turntable-solve",
        progress="enough captures",
    )


def _solve_chain(*, again: bool) -> GuideNow:
    return _now(
        stage="chain",
        action="solve",
        instruction="Solve the whole chain again: everything from all captures together."
        if again
        else "Solve the whole chain: everything from all captures together.",
        why="Captures of the ball on an axis tell where the scanner is, too: together all becomes better.",
        exit="Its answers agree with those of the steps within their uncertainties.",
        drawing="chain-solve",
        progress="each step solved",
    )


def _review(result: Mapping[str, Any]) -> GuideNow:
    chain = result.get("stage") == "chain"
    now = review(
        result,
        "Look at the result: its uncertainty, the residuals, what is left at each reading.",
        step="turntable",
        stage="chain" if chain else "turntable",
        exit_="You trust it: its frames are then ready for the controller and for merging scans.",
        drawings=("turntable-done", "turntable-height"),
    )
    if now.action == "review" and has_code(result, PLAY_NOT_CHECKED):
        return now.model_copy(update={"why": sentences((now.why, ASK_FOR_PLAY))})
    return now


def _now(**fields: Any) -> GuideNow:
    return GuideNow.model_validate({"step": "turntable", "stage": "turntable", **fields})
