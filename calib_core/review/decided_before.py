"""Decisions of a verification that were followed by other captures or other limits: told beside the last one."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from calib_core.archive.seals import decisions_sealed, seal_state
from calib_core.records import ResultsData, Session, parse_session
from calib_core.records.decided_before import DecidedBefore, LeftOut
from calib_core.steps import table_stages, tool_stages

Solved = tuple[Mapping[str, Any], Session | None]
"""A result of `verify` as JSON data, and the session that it was solved from as far as that is known."""


def decided_before(verifications: Sequence[Solved], now: Session) -> list[DecidedBefore]:
    """Return the decisions after which the evidence was changed, and those that the last one's seal alone knows.

    Parameters
    ----------
    verifications : sequence of Solved
        All that the session had, the oldest first: their sessions say who changed what, and why.
    now : Session
        As it is now, for those without one.
    """
    there = {_when(one) for one, _ in verifications if seal_state(one) is not False}
    found = [
        known.model_copy(update={"text": known.said()})
        for one in decisions_sealed(verifications[-1][0] if verifications else {})
        if one["solved"] not in there
        for known in [DecidedBefore(decision=one["decision"], solved=one["solved"], removed=True)]
    ]
    for (before, from_before), (after, solved_from) in pairwise(verifications):
        if before.get("decision") is None:
            continue
        captures = {capture.id: capture for capture in (solved_from or now).captures}
        out = {name: one.excluded_because for name, one in captures.items()}
        back = {name: one.included_because for name, one in captures.items() if one.included_because}
        used, then = _used(before), _used(after)
        if from_before is not None and solved_from is not None:  # so is another calibration
            used, then = [*_calibrating(from_before), *used], [*_calibrating(solved_from), *then]
        added = [name for name in then if name not in used]
        told = DecidedBefore(
            decision=before["decision"],
            solved=before.get("solved"),
            left_out=[LeftOut(capture=name, because=out.get(name)) for name in used if name not in then],
            added=added,
            limits=[name for name, mm in _limits(before).items() if _limits(after).get(name) != mm],
            taken_back=[LeftOut(capture=name, because=back[name]) for name in added if name in back],
        )
        if told.left_out or told.added or told.limits:
            found.append(told.model_copy(update={"text": told.said()}))
    return found


def decided_before_in(
    past: Mapping[str, Any], session: Session, results: ResultsData
) -> tuple[DecidedBefore, ...]:
    """Return the same of a session by the past that its folder keeps."""
    if "verify" not in results:
        return ()
    told = [one for one in past["results"] if one["stage"] == "verify" and one.get("record")]
    origins = [(one.get("solved_from") or {}).get("session") for one in told]
    before = [
        (
            one["record"] if one["record"].get("seal") else {"solved": one.get("created"), **one["record"]},
            parse_session(origin, "history.json") if origin else None,
        )
        for one, origin in zip(told, origins, strict=True)
    ]
    return tuple(decided_before([*before, (results["verify"], session)], session))


def _when(result: Mapping[str, Any]) -> str:
    """Return when it was solved, by which later seals know it; of earlier versions when it was sealed."""
    return str(result.get("solved") or (result.get("seal") or {}).get("at") or "")


def _used(result: Mapping[str, Any]) -> list[str]:
    return [row["capture"] for row in result.get("residuals", []) if row.get("used")]


def _calibrating(session: Session) -> list[str]:
    stages = {*tool_stages(), *table_stages()}
    return [capture.id for capture in session.captures if capture.step in stages and not capture.excluded]


def _limits(result: Mapping[str, Any]) -> dict[str, float | None]:
    return {check["name"]: check.get("limit_mm") for check in result.get("checks", [])}
