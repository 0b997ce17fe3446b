"""What to do now: computed from the captures, what was measured in them, and the results; nothing is stored."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from calib_core.captures.contradictions import without_scanner
from calib_core.cell.carriers import ball_on_flange
from calib_core.cell.found import told_by_axes
from calib_core.cell.titles import object_only_slides, step_title
from calib_core.findings import (
    as_read,
    complete_measured,
    findings_in,
    judgement,
    measured_judgement,
    with_severities,
)
from calib_core.graph.registry import stages
from calib_core.graph.stage import Stage
from calib_core.messages import message, plural
from calib_core.records import (
    Capture,
    Cell,
    Guide,
    GuideLast,
    GuideNow,
    GuideStatus,
    GuideStep,
    Measured,
    Result,
    ResultsData,
    Session,
    Severity,
)
from calib_core.stages.boards_seen import coverage_so_far
from calib_core.stages.reviewed import OF_BALL
from calib_core.steps import capture_steps, steps_that_show

_ENDED: tuple[GuideStatus, ...] = ("done", "known", "not-needed")


@dataclass(frozen=True, eq=False)
class GuideView:
    """What a stage's guide sees.

    Attributes
    ----------
    session : Session
    measured : sequence of Measured
        What was seen in the captures; those without count as good.
    results : mapping
        From stage to the JSON data of its result, with ``stale: true`` where its inputs have changed since.
    statuses : mapping
        How far each guided step is.
    """

    session: Session
    measured: Sequence[Measured]
    results: ResultsData
    statuses: Mapping[str, GuideStatus]

    def captures(self, step: str) -> list[Capture]:
        """Return the captures of a step that are not excluded."""
        return [c for c in self.session.captures if c.step == step and not c.excluded]

    def fresh(self, stage: str) -> Mapping[str, Any] | None:
        """Return a stage's result where it is up to date."""
        result = self.results.get(stage)
        return None if result is None or result.get("stale") else result


def guide(
    session: Session,
    measured: Sequence[Measured],
    results: Mapping[str, Result | Mapping[str, Any]],
    stale: Collection[str] = (),
) -> Guide:
    """Return what to do now and why, how much is still needed, and where every step stands.

    Parameters
    ----------
    session : Session
    measured : sequence of Measured
        What was seen in the captures; those without count as good.
    results : mapping of stage to result
        Records or their JSON data, which may say ``stale: true`` themselves.
    stale : collection of str
        The stages whose results are stale, as `Graph.stale` tells.
    """
    severities = session.cell.findings
    data = {stage: _data(result, stage in stale, severities) for stage, result in results.items()}
    statuses: dict[str, GuideStatus] = {}
    blocked = False
    for stage in stages():
        waits = blocked
        for step in stage.guided:
            statuses[step] = _status(stage, step, session, data, blocked=waits)
            waits = waits or statuses[step] not in _ENDED
        blocked = blocked if stage.optional else waits
    view = GuideView(session, measured, data, statuses)
    revised = {step for stage in stages() if _is_revised(stage, data) for step in stage.guided}
    steps = [
        GuideStep(
            step=s,
            status=status,
            title=step_title(session.cell, s),
            note=_note(session, s, status, revised=s in revised),
        )
        for s, status in statuses.items()
    ]
    current, last = _drawn(session.cell, _now(view)), _last(session, measured)
    result = view.fresh(current.stage) if current.stage is not None else None
    found = [] if result is None else findings_in(result)
    found = [*found, *without_scanner(session.cell, session.captures)]
    told = [*(last.findings if last else []), *with_severities(found, severities)]
    seen = coverage_so_far(session, measured)
    return Guide(
        steps=steps, current=current, findings=judgement(told)["findings"], last_capture=last, coverage=seen
    )


def _drawn(cell: Cell, now: GuideNow) -> GuideNow:
    """Return an instruction whose drawing shows what the cell has: a ball on the flange, an axis that slides."""
    drawing = OF_BALL.get(now.drawing, now.drawing) if ball_on_flange(cell) else now.drawing
    if drawing.startswith("turntable-") and object_only_slides(cell):
        drawing = "slide"
    return now.model_copy(update={"drawing": drawing})


def _data(
    result: Result | Mapping[str, Any], stale: bool, severities: Mapping[str, Severity] | None
) -> dict[str, Any]:
    data: dict[str, Any] = dict(result.to_json() if isinstance(result, Result) else result)
    data = as_read(data, severities=severities) if severities else data
    data["stale"] = bool(data.get("stale")) or stale
    return data


def _status(
    stage: Stage, step: str, session: Session, data: Mapping[str, dict[str, Any]], *, blocked: bool
) -> GuideStatus:
    if stage.is_brought(session):
        return "known"
    if not stage.is_wanted(session):
        return "not-needed"
    result = _answer(stage, data)
    if result is not None:
        if result.get("stale"):
            return "stale"
        return "failing" if result.get("verdict") == "fail" else "done"
    if stage.step is not None and any(c.step == stage.step.name and not c.excluded for c in session.captures):
        return "working" if step == stage.step.name else "todo"
    return "later" if blocked else "todo"


def _answer(stage: Stage, data: Mapping[str, dict[str, Any]]) -> dict[str, Any] | None:
    """Return a stage's result, or that of one which answers its question too, where that is better."""
    result = data.get(stage.name)
    holds = result is not None and not result["stale"] and result.get("verdict") != "fail"
    for other in stages():
        more = data.get(other.name) if stage.name in other.answers else None
        if more is None or (holds and more.get("verdict") == "fail"):
            continue
        if result is None or not more["stale"]:
            return more
    return result


def _is_revised(stage: Stage, data: Mapping[str, dict[str, Any]]) -> bool:
    """Return whether the method has been revised since a stage was solved: its result stays valid."""
    result = data.get(stage.name)
    return result is not None and result.get("method_revision", 1) < stage.method_revision


def _note(session: Session, step: str, status: GuideStatus, *, revised: bool) -> str | None:
    if revised:
        return "the method was revised since; the answer stays valid, solve anew to use the new one"
    if status == "not-needed" and step == "turntable":
        return message("the cell tells of no turntable: where there is one, say so in the cell's description")
    if status == "not-needed" and step in steps_that_show("sphere"):
        if told_by_axes(session.cell, session.captures):
            return message("the spheres on axes tell it; captures of one that stands still make it surer")
        return message(
            "scanner and table are solved to each other; in the robot's base only with captures of step 'tcp'"
        )
    if status == "not-needed":
        if session.cell.scanner.kind == "center":
            return message("the scanner delivers centres already")
        return message("the scanner delivers points already")
    if status == "known":
        return "given with the cell"
    count = sum(c.step == step and not c.excluded for c in session.captures)
    return plural("{count} capture", "{count} captures", by="count", count=count) if count else None


def _now(view: GuideView) -> GuideNow:
    """Return what the first stage asks for that asks for something; else the last look at a result."""
    look: GuideNow | None = None
    for stage in stages():
        if any(view.statuses[step] == "not-needed" for step in stage.guided):
            continue
        now = stage.guide(view)
        if now is None:
            continue
        look = now
        if now.action != "review" or any(view.statuses[step] not in _ENDED for step in stage.guided):
            return now
    return look or _ended()


def _ended() -> GuideNow:
    """Return what is said where every stage is brought or done, and none asks for anything."""
    last = capture_steps()[-1]
    return GuideNow(
        step=last.name,
        action="capture",
        instruction=last.to_capture,
        why="Everything before is given with the cell.",
        exit="What you want to see was captured.",
        drawing="scan-first",
    )


def _last(session: Session, measured: Sequence[Measured]) -> GuideLast | None:
    """Return how the last capture of the session was, if it was measured."""
    if not session.captures:
        return None
    last = session.captures[-1].id
    seen = next((m for m in measured if m.capture == last), None)
    if seen is None:
        return None
    if not seen.findings:
        found = complete_measured(seen).findings
        return GuideLast(capture=last, verdict=seen.verdict, findings=found, reason=seen.reason, to_do=seen.to_do)
    return GuideLast(capture=last, **measured_judgement(with_severities(seen.findings, session.cell.findings)))
