"""What to do now: computed from the captures, what was measured in them, and the results; nothing is stored."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

from calib_core.records import (
    Guide,
    GuideLast,
    GuideNow,
    GuideStatus,
    GuideStep,
    Measured,
    Result,
    Session,
)
from calib_core.stages.camera.guide import camera_now, laser_plane_now
from calib_core.stages.graph import STAGES, stage_captures
from calib_core.stages.merge.guide import scan_captures, scan_now
from calib_core.stages.tcp.guide import tcp_now
from calib_core.stages.turntable.guide import turntable_now, wants_turntable

StepName = Literal["camera", "laser-plane", "tcp", "turntable", "verify", "scan", "merge"]
STEPS: tuple[StepName, ...] = get_args(StepName)
_TO_THE_TCP: tuple[StepName, ...] = ("camera", "laser-plane", "tcp")
_ENDED: tuple[GuideStatus, ...] = ("done", "known", "not-needed")


def guide(
    session: Session, measured: Sequence[Measured], results: Mapping[str, Result | Mapping[str, Any]]
) -> Guide:
    """Return what to do now and why, how much is still needed, and where every step stands.

    Parameters
    ----------
    session : Session
    measured : sequence of Measured
        What was seen in the captures; those without count as good.
    results : mapping of stage to result
        Records or their JSON data.  A result is stale where its data says ``stale: true``, or where it was
        computed from other captures than the session has now.
    """
    data = {stage: _with_stale(session, stage, result) for stage, result in results.items()}
    statuses: dict[StepName, GuideStatus] = {}
    for step in STEPS:
        statuses[step] = _status(session, step, data, blocked=_blocked(step, statuses))
    steps = [GuideStep(step=s, status=statuses[s], note=_note(session, s, statuses[s])) for s in STEPS]
    return Guide(
        steps=steps, current=_now(session, measured, data, statuses), last_capture=_last(session, measured)
    )


def _with_stale(session: Session, stage: str, result: Result | Mapping[str, Any]) -> dict[str, Any]:
    data: dict[str, Any] = dict(result.to_json() if isinstance(result, Result) else result)
    rows: list[dict[str, Any]] = data.get("residuals") or []
    if rows and stage in STAGES:
        captures = stage_captures(session, stage)
        known = {row["capture"] for row in rows}
        used = {row["capture"] for row in rows if row.get("used")}
        now = {c.id for c in captures if not c.excluded}
        left_out = {row["capture"] for row in rows if str(row.get("reason")).startswith("excluded")}
        # What was left out by hand has a row too: it may be gone without harm, and must not have come back.
        same = used <= now <= known - left_out
        data["stale"] = bool(data.get("stale")) or not same
    return data


def _status(session: Session, step: StepName, data: Mapping[str, dict[str, Any]], *, blocked: bool) -> GuideStatus:
    known = session.cell.known
    brought = {
        "camera": known.camera,
        "laser-plane": known.laser_plane,
        "tcp": known.tool0_from_laser,
        "turntable": known.base_from_turntable,
    }.get(step)
    if brought is not None:
        return "known"
    if step in ("camera", "laser-plane") and not _uses_frames(session):
        return "not-needed"
    result = data.get("merge" if step == "scan" else step)
    chain = data.get("chain")
    if step in ("tcp", "turntable") and chain is not None and (result is None or not chain.get("stale")):
        result = chain  # the whole chain answers both
    if result is not None:
        if result.get("stale"):
            return "stale"
        return "failing" if result.get("verdict") == "fail" else "done"
    wanted = "scan" if step == "merge" else step
    if any(c.step == wanted and not c.excluded for c in session.captures):
        return "todo" if step == "merge" else "working"
    return "later" if blocked else "todo"


def _uses_frames(session: Session) -> bool:
    """Whether the scanner delivers camera frames, so that camera and laser plane must be calibrated first."""
    if session.cell.scanner.kind is not None:
        return session.cell.scanner.kind == "frame"
    return any(c.kind == "frame" or c.step in ("camera", "laser-plane") for c in session.captures)


def _blocked(step: StepName, before: Mapping[StepName, GuideStatus]) -> bool:
    """Whether a step waits for one before it; nothing waits for verifying, and scans need no turntable."""
    free = ("verify",) if step == "turntable" else ("verify", "turntable")
    return any(status not in _ENDED for earlier, status in before.items() if earlier not in free)


def _note(session: Session, step: StepName, status: GuideStatus) -> str | None:
    if status == "not-needed":
        return f"the scanner delivers {'centres' if session.cell.scanner.kind == 'center' else 'points'} already"
    if status == "known":
        return "given with the cell"
    count = sum(c.step == step and not c.excluded for c in session.captures)
    return f"{count} capture{'' if count == 1 else 's'}" if count else None


def _now(
    session: Session,
    measured: Sequence[Measured],
    data: Mapping[str, dict[str, Any]],
    statuses: Mapping[StepName, GuideStatus],
) -> GuideNow:
    open_steps: list[StepName] = [s for s in _TO_THE_TCP if statuses[s] not in _ENDED]
    step: StepName = open_steps[0] if open_steps else "tcp"
    boards = laser_plane_now(session, measured, data.get("laser-plane"))
    if step == "camera" and not (statuses["camera"] == "stale" and _is_under_way(session, boards)):
        return camera_now(session, measured, data.get("camera"))
    if step in ("camera", "laser-plane"):
        return boards
    tcp = data.get("tcp") or data.get("chain")
    doubtful = tcp is not None and bool(tcp.get("undetermined"))
    if not open_steps and not doubtful:
        if wants_turntable(session):
            table = turntable_now(session, measured, data)
            return scan_now(session, measured, data) if _is_settled(table, data) else table
        if scan_captures(session):
            return scan_now(session, measured, data)
    if statuses["tcp"] == "known":
        return GuideNow(
            step="verify",
            stage="verify",
            action="capture",
            instruction="Take captures of the sphere from poses that were not used for the TCP.",
            why="The TCP was given with the cell; only captures of its own show how good it is here.",
            exit="Ten captures from different sides.",
            drawing="tcp-first",
        )
    return tcp_now(session, measured, tcp)


def _is_settled(table: GuideNow, data: Mapping[str, dict[str, Any]]) -> bool:
    """Whether the turntable asks for nothing more and may be scanned on."""
    return table.action == "review" and data[str(table.stage)].get("verdict") != "fail"


def _is_under_way(session: Session, boards: GuideNow) -> bool:
    """Whether stripes on boards are being taken: they count for the camera too, which waits for all of them."""
    return boards.action == "capture" and any(c.step == "laser-plane" and not c.excluded for c in session.captures)


def _last(session: Session, measured: Sequence[Measured]) -> GuideLast | None:
    """Return how the last capture of the session was, if it was measured."""
    if not session.captures:
        return None
    last = session.captures[-1].id
    seen = next((m for m in measured if m.capture == last), None)
    return seen and GuideLast(capture=last, verdict=seen.verdict, reason=seen.reason, to_do=seen.to_do)
