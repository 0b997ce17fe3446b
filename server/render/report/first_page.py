"""The report's first page: what was calibrated, on what, when, by whom, what came out, and what was decided."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Final, Literal

from calib_core.captures.certificate import overdue_certificates
from calib_core.errors import ConflictError
from calib_core.evidence.html import STALE
from calib_core.evidence.numbers import limit_of, plus_minus, pointed, quantity, quantity_text
from calib_core.evidence.text import MOST_IN_SIGHT, figure_text, verdict_words
from calib_core.exports.answer import answer_of
from calib_core.findings import in_language
from calib_core.findings.codes.faults import FAULT_CODES
from calib_core.messages import ENGLISH, Catalogue, Message, message, plural
from calib_core.moment import now, said_moment
from calib_core.records import Capture, ReadFile, Session
from calib_core.records.decided_before import DECISIONS, DecidedBefore
from calib_core.records.evidence import AnyBlock, Figure
from calib_core.records.faults import in_order
from calib_core.records.policy import Equipment
from calib_core.review.answer import cell_id
from calib_core.review.standing import said_release, said_signed
from calib_core.stages.evidence import title_of
from calib_core.stages.verify.limits import said_change
from calib_core.steps import capture_steps
from server.render.report.words import KINDS, WORDS

ON_FIRST_PAGE: Final = ("customer", "operator", "place", "procedure", "received", "replaces")
"""What of `documentation` stands there; the report's number heads every page, and the rest follows."""

_HASH_SHOWN = 8
_UNIT = re.compile(r"(?<=\d) (?=%|mm\b)")  # a line does not end before it
Data = Mapping[str, Any]
Rows = list[tuple[str, str]]


@dataclass(frozen=True)
class Circumstances:
    """What a report tells beside session and results.

    Attributes
    ----------
    solved : str
        When the answer was solved (ISO 8601), "" where that is not known.
    date_signed : bool
        Whether it was solved here, or where somebody who is trusted here signed so: else the date is only told.
    release : mapping or None
        The release that put this answer in force: `number`, `who`, `why`, `created`, `in_spite_of`
        (faults), `signed`.
    of_moment : sequence of str
        Faults of the moment when it was printed, by name.
    decided_before : sequence of DecidedBefore
    acknowledged : sequence of Message
        Who acknowledged that cell or equipment had changed, when and why.
    digests : mapping
        The SHA-256 of files that lie beside the session, by their names: of certificates.
    language : Catalogue
    paper : str
    read : callable, optional
        Gives the captures' files, of which the evidence shows some.
    """

    solved: str = ""
    date_signed: bool = True
    release: Data | None = None
    of_moment: Sequence[str] = ()
    decided_before: Sequence[DecidedBefore] = ()
    acknowledged: Sequence[Message] = ()
    digests: Mapping[str, str] = field(default_factory=dict[str, str])
    language: Catalogue = field(default=ENGLISH)
    paper: Literal["A4", "letter"] = "A4"
    read: ReadFile | None = None

    def say(self, name: str, **values: object) -> str:
        """Return one of the report's own texts."""
        return self.language.say(message(WORDS[name], **values)) if values else self.language.say(WORDS[name])

    def pointed(self, text: str) -> str:
        """Return a number with the decimal sign of the report's language."""
        return pointed(text, self.language.language)


def report_number(session: Session, results: Mapping[str, Data], about: Circumstances) -> str:
    """Return the number that was told, else one of cell, signed date and what it was computed from."""
    told = (session.documentation or {}).get("report_number")
    if told:
        return told
    hashed = next((str(one["inputs_sha256"]) for one in results.values() if one.get("inputs_sha256")), "")
    date = about.solved[:10].replace("-", "") if about.date_signed else ""
    parts = (cell_id(session), date, hashed[:_HASH_SHOWN])
    return "-".join(part for part in parts if part)


def identification(session: Session, stage: str | None, told: Circumstances) -> Rows:
    """Return what was calibrated, on what, when and by whom, as far as it was told."""
    documentation = session.documentation or {}
    equipment = session.cell.equipment or []
    rows = [
        ("subject", told.language.say(title_of(stage, session.cell)) if stage else ""),
        ("scanner", _pieces(equipment, "scanner") or _scanners(session, told.language.say)),
        ("robot", _pieces(equipment, "robot") or session.cell.robot.brand or ""),
        ("cell", cell_id(session)),
        *((name, documentation.get(name, "")) for name in ON_FIRST_PAGE),
        ("captured", _captured(session.captures, told)),
        ("solved", _computed(told)),
        ("captures", _captures(session, told.language.say)),
    ]
    return [(told.say(name), text) for name, text in rows if text]


def _computed(told: Circumstances) -> str:
    """Return when it was solved, and where nobody proves that, that it is only told."""
    moment = said_moment(told.solved) if told.solved else ""
    return moment if told.date_signed or not moment else told.say("date unsigned", moment=moment)


def _scanners(session: Session, say: Callable[[str], str]) -> str:
    kind = session.cell.scanner.kind or ""
    return ", ".join(session.cell.scanners or ()) or say(KINDS.get(kind, kind))


def _pieces(equipment: Iterable[Equipment], kind: str) -> str:
    of_kind = [(one.name, one.model, one.serial) for one in equipment if one.kind == kind]
    return ", ".join(" ".join(part for part in parts if part) for parts in of_kind if any(parts))


def _captured(captures: Iterable[Capture], told: Circumstances) -> str:
    """Return when the captures were taken, and by which clock where all have the same."""
    dated = [one for one in captures if one.taken]
    span, clocks = _span(one.taken for one in dated), {one.clock for one in dated}
    clock = clocks.pop() if len(clocks) == 1 else None
    return f"{span} ({told.say(f'clock_{clock}')})" if clock else span


def _span(moments: Iterable[str | None]) -> str:
    """Return the first and the last of some moments."""
    told = sorted((one for one in moments if one), key=_instant)
    ends = list(dict.fromkeys(said_moment(one) for one in (*told[:1], *told[-1:])))
    return " – ".join(ends)


def _instant(moment: str) -> float:
    try:
        when = datetime.fromisoformat(moment)
    except ValueError:
        return 0.0
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def step_title(name: str, say: Callable[[str], str]) -> str:
    """Return a step as people call it."""
    return next((say(step.title) for step in capture_steps() if step.name == name), name)


def _captures(session: Session, say: Callable[[str], str]) -> str:
    """Return how many captures each step has, and how many were left out by hand."""
    steps = dict.fromkeys(capture.step for capture in session.captures)
    parts: list[str] = []
    for step in steps:
        of_step = [capture for capture in session.captures if capture.step == step]
        excluded = sum(capture.excluded for capture in of_step)
        told = plural("{count} left out by hand", "{count} left out by hand", by="count", count=excluded)
        parts.append(f"{step_title(step, say)} {len(of_step)}" + (f" ({say(told)})" if excluded else ""))
    return ", ".join(parts)


def outcome(
    session: Session, results: Mapping[str, Data], blocks: Mapping[str, list[AnyBlock]], told: Circumstances
) -> Data | None:
    """Return the answer with its uncertainty, what was decided by which rule, and what is to be remarked.

    Without an answer it is the first result that there is; None where nothing is solved.
    """
    stale = [name for name, result in results.items() if result["stale"]]
    try:
        answer = replace(answer_of(session, results, stale), of_moment=tuple(told.of_moment))
        stage, verdict, faults = answer.stage, answer.verdict, answer.all_faults
    except ConflictError:
        stage = next(iter(results), "")
        if not stage:
            return None
        verdict, faults = results[stage]["verdict"], ()
    word, meaning = verdict_words(verdict, told.language)
    wanted = session.cell.wanted_mm
    verify = results.get("verify", {})
    decision = verify.get("decision")
    compared = results.get("merge", {}).get("deviation")
    figures = [
        (block.label, _UNIT.sub("\N{NO-BREAK SPACE}", told.pointed(figure_text(block, told.language))))
        for block in [*blocks[stage], *(blocks["merge"] if compared and stage != "merge" else [])]
        if isinstance(block, Figure) and block.headline
    ]
    return {
        "stage": stage,
        "verdict": verdict,
        "word": word,
        "meaning": meaning,
        "figures": figures,
        "expanded": told.say("expanded") if any("±" in text for _, text in figures) else "",
        "wanted": told.pointed(quantity_text(plus_minus(wanted / 2, "mm"))) if wanted else "",
        "decision": decision or "",
        "decided": told.language.say(DECISIONS.get(str(decision), str(decision))) if decision else "",
        "undecided": "" if decision else told.say("no limits" if verify else "no verification"),
        "checks": [_check(check, told) for check in verify.get("checks") or []],
        "remarks": [
            *_amended(session, told),
            *_overdue(session, told),
            *_limit_changes(session, told),
            *_remarks(faults, bool(stale), told),
            *map(told.pointed, (results[stage].get("warnings") or ())[:MOST_IN_SIGHT]),
            *map(told.pointed, (verify.get("warnings") or ())[:MOST_IN_SIGHT] if stage != "verify" else ()),
        ],
        "inputs_sha256": results[stage].get("inputs_sha256", ""),
    }


def _check(check: Data, told: Circumstances) -> Data:
    limit = check.get("limit_mm")
    decision = check.get("decision")
    measured = quantity(check["value_mm"], "mm", (check["uncertainty_mm"] or 0.0) / 2 or None)
    return {
        "title": told.language.say(str(check["title"])),
        "measured": told.pointed(quantity_text(measured)),
        "limit": told.say("not limited")
        if limit is None
        else told.pointed(quantity_text(limit_of(limit, measured))),
        "decision": decision or "",
        "decided": told.language.say(DECISIONS.get(str(decision), str(decision))) if decision else "–",
    }


def _amended(session: Session, told: Circumstances) -> list[str]:
    """Return which report this one replaces, and why (ISO/IEC 17025, 7.8.8)."""
    documentation = session.documentation or {}
    if not documentation.get("replaces"):
        return []
    why = documentation.get("replaces_because") or told.language.say(message("none given"))
    return [told.say("amended", number=documentation["replaces"], why=why)]


def _overdue(session: Session, told: Circumstances) -> list[str]:
    found = overdue_certificates(session, told.solved or now())
    return [in_language(one, told.language.language).text for one in found]


def _limit_changes(session: Session, told: Circumstances) -> list[str]:
    return [told.language.say(said_change(one)) for one in session.cell.verification.changes or ()]


def _remarks(faults: Sequence[str], stale: bool, told: Circumstances) -> list[str]:
    """Return what whoever signs must know: decisions before, and what speaks against its use."""
    return [
        *(told.language.say(one.said()) for one in told.decided_before),
        *(FAULT_CODES[name].said({}, (), told.language) for name in faults),
        *([told.language.say(STALE)] if stale and "stale" not in faults else ()),
    ]


def approval(told: Circumstances) -> list[str]:
    """Return who released the answer, when and why, and what must be known of it; that nobody did."""
    release, acknowledged = told.release, map(told.language.say, told.acknowledged)
    if release is None:
        return [told.say("not released"), *acknowledged]
    faults = " ".join(FAULT_CODES[name].said({}, (), told.language) for name in in_order(release["in_spite_of"]))
    more = [told.say("in spite of", faults=faults)] if faults else []
    return [told.language.say(said_signed(said_release(release), release)), *more, *acknowledged]


def plain_text(text: str) -> str:
    """Return text as it may stand in a string of a style sheet."""
    return re.sub(r"[^\w .,:()#+/-]", " ", text)
