"""Decisions of a verification that were followed by other captures or other limits: told beside the last one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

from calib_core.archive.seals import decisions_sealed, seal_state
from calib_core.records import Capture, ResultsData, Session, parse_session
from calib_core.records.decided_before import DecidedBefore, LeftOut
from calib_core.records.policy import Excluded, Removed
from calib_core.review.compare import changes
from calib_core.steps import table_stages, tool_stages

_NO_EVIDENCE: Final = {
    "excluded", "excluded_because", "included_because", "added_because", "changed_because", "taken", "clock",
    "source",
}  # fmt: skip
"""What of a capture's record no stage reads."""
_NOT_MEASURED_WITH: Final = {"verification", "findings", "release", "merge", "id", "wanted_mm"}

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
        told = _changed_after(before, from_before, after, solved_from or now, is_known=solved_from is not None)
        if not (told.left_out or told.added or told.limits or told.changed or told.cell):
            is_known = from_before is not None and solved_from is not None
            if is_known or not _has_other_inputs(before, after):
                continue
            told = told.model_copy(update={"otherwise": True})
        found.append(told.model_copy(update={"text": told.said()}))
    return found


def _changed_after(
    before: Mapping[str, Any], origin: Session | None, after: Mapping[str, Any], now: Session, *, is_known: bool
) -> DecidedBefore:
    """Return a decision with what was changed until the next one; so is another calibration, where it is known."""
    captures = {capture.id: capture for capture in now.captures}
    used, then = _used(before), _used(after)
    if origin is not None and is_known:
        used, then = [*_calibrating(origin), *used], [*_calibrating(now), *then]
    gone = {one.capture: one for one in _removed(now) if one not in _removed(origin) and one.capture in used}
    gone = {name: one for name, one in gone.items() if origin is not None or one.when > _when(before)}
    out: list[LeftOut] = []
    for name in used:
        if name in gone:
            because = Excluded.model_validate(gone[name].model_dump(include={*Excluded.model_fields}))
            out.append(LeftOut(capture=name, because=because, deleted=True))
        elif name not in then:
            one = captures.get(name)
            because = one and (one.excluded_because or one.changed_because)  # or it is of another step since
            out.append(LeftOut(capture=name, because=because, deleted=one is None))
    added = [name for name in then if name not in used or name in gone]
    back = {name: one for name in added if (one := captures[name].included_because if name in captures else None)}
    came = [name for name in added if name not in back]
    stayed = [name for name in dict.fromkeys(then) if name not in added]
    return DecidedBefore(
        decision=before["decision"],
        solved=before.get("solved"),
        left_out=out,
        added=added,
        limits=[name for name, mm in _limits(before).items() if _limits(after).get(name) != mm],
        taken_back=[LeftOut(capture=name, because=one) for name, one in back.items()],
        came=[
            LeftOut(capture=name, because=captures[name].added_because if name in captures else None)
            for name in came
        ],
        changed=[*_corrected(origin if is_known else None, captures, stayed, _when(before))],
        cell=_of_cell(origin, now) if origin is not None and is_known else [],
    )


def _has_other_inputs(before: Mapping[str, Any], after: Mapping[str, Any]) -> bool:
    """Return whether one program solved both from other inputs: a folder keeps no earlier poses and files."""
    same = ("software", "method_revision")
    return all(before.get(name) == after.get(name) for name in same) and before.get("inputs_sha256") != after.get(
        "inputs_sha256"
    )


def _of_cell(before: Session, after: Session) -> list[str]:
    """Return the fields of the cell that are others than then; limits are told by themselves."""
    found = [one.what for one in changes(before, after) if one.kind == "cell"]
    return [path for path in found if path.partition(".")[0] not in _NOT_MEASURED_WITH]


def _removed(session: Session | None) -> list[Removed]:
    return (session and session.removed) or []


def _corrected(
    origin: Session | None, captures: Mapping[str, Capture], names: Iterable[str], since: str
) -> Iterator[LeftOut]:
    """Give the captures whose record is another than then, with the fields that are as far as these are known."""
    then = {capture.id: capture for capture in (origin.captures if origin else ())}
    for one in (captures[name] for name in names if name in captures):
        because, fields = one.changed_because, _differing(then[one.id], one) if one.id in then else []
        if fields or (origin is None and because is not None and because.when > since):
            yield LeftOut(capture=one.id, because=because, fields=fields)


def _differing(before: Capture, after: Capture) -> list[str]:
    records = (before.to_json(), after.to_json())
    then, now = ({name: value for name, value in one.items() if name not in _NO_EVIDENCE} for one in records)
    return [name for name in {**then, **now} if then.get(name) != now.get(name)]


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
