"""A judgement, made of findings once: verdict, warnings, notes, causes, and the captures' reasons."""

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any, Final, TypeVar

from calib_core.findings.bridge import complete, complete_measured
from calib_core.findings.code import Choice, Code, Plural
from calib_core.findings.table import CODES
from calib_core.messages import ENGLISH, Catalogue, Message, Names, Value, message_of
from calib_core.records import Measured, Result, RootCause, Verdict
from calib_core.records.findings import Finding, Severity

_ORDER: Final = ("error", "warning", "note")
_VERDICTS: Final[Mapping[Severity, Verdict]] = {"error": "fail", "warning": "warn", "note": "pass"}
_R = TypeVar("_R", bound=Result)


def verdict_of(findings: Iterable[Finding]) -> Verdict:
    """Return `fail` with an error, `warn` with a warning, else `pass`; what only follows does not count."""
    return worst_of(_VERDICTS[finding.severity] for finding in findings if finding.behind is None)


def has(findings: Iterable[Finding], *codes: Code) -> bool:
    """Return whether one of the codes is among the findings."""
    names = {code.name for code in codes}
    return any(finding.code in names for finding in findings)


def has_code(result: Mapping[str, Any], *codes: Code) -> bool:
    """Return whether a result, given as JSON data, has a finding of one of these codes."""
    names = {code.name for code in codes}
    return any(finding["code"] in names for finding in result.get("findings") or [])


def judgement(findings: Iterable[Finding], language: Catalogue = ENGLISH) -> dict[str, Any]:
    """Return the fields of a result that are made of its findings: errors first, then warnings, then notes.

    Within a severity what has a remedy is a cause, and stands before what it may have brought about; before an
    error only where its code says so.
    """
    hidden = _hidden(list(findings))
    leading = {
        name for one in hidden if one.behind is None and one.code in CODES for name in CODES[one.code].led_by
    }
    found = sorted(hidden, key=lambda one: _rank(one, leading))
    shown = [finding for finding in found if finding.behind is None]
    return {
        "findings": found,
        "verdict": verdict_of(found),
        "warnings": [sentence_of(finding, language) for finding in shown if finding.severity != "note"],
        "notes": [sentence_of(finding, language) for finding in shown if finding.severity == "note"],
        "causes": causes_of(_told_with_causes(found)),
    }


def _rank(finding: Finding, leading: Container[str]) -> tuple[int, bool]:
    is_cause = finding.remedy is not None and finding.behind is None
    severity = "error" if is_cause and finding.code in leading else finding.severity
    return _ORDER.index(severity), not is_cause


def measured_judgement(findings: Iterable[Finding], language: Catalogue = ENGLISH) -> dict[str, Any]:
    """Return what of a measured capture is made of its findings: verdict, reason, and what to do."""
    told = judgement(findings)
    found: list[Finding] = told["findings"]
    notes = [sentence_of(finding, language) for finding in found if finding.severity == "note"]
    doubts = [finding for finding in found if finding.severity != "note"]
    reason = language.sentences([*(finding.text for finding in doubts), *notes])
    to_do = language.sentences(dict.fromkeys(finding.to_do for finding in doubts))
    return {"findings": found, "verdict": told["verdict"], "reason": reason or None, "to_do": to_do or None}


def measured_with(measured: Measured, more: Sequence[Finding]) -> Measured:
    """Return what was measured in a capture with further findings."""
    found = [*complete_measured(measured).findings, *more]
    return measured.model_copy(update=measured_judgement(found)) if more else measured


def worst_of(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst of several verdicts."""
    found = set(verdicts)
    return "fail" if "fail" in found else "warn" if "warn" in found else "pass"


def message_of_finding(finding: Finding) -> str:
    """Return what a finding says as a message, so that it can be a value of another."""
    code = CODES[finding.code]
    return _as_message(finding, code.text, code.by)


def to_do_of(finding: Finding) -> str:
    """Return what a finding says is to be done as a message; nothing where it says nothing."""
    code = CODES[finding.code]
    return _as_message(finding, code.to_do, code.by_to_do or code.by) if code.to_do else ""


def _as_message(finding: Finding, choice: Choice, by: str) -> str:
    places = {"captures": Names(finding.captures), **places_in(finding)}
    text = choice[str(places[by])] if isinstance(choice, Mapping) else choice
    return Message(text.one, places, text.many, text.by) if isinstance(text, Plural) else Message(text, places)


def _told_with_causes(found: list[Finding]) -> list[Finding]:
    """Return what is shown, and the alternatives to a cause that explains all."""
    alternatives = [f for f in found if f.behind and (code := CODES.get(f.code)) and code.explains_all]
    return [finding for finding in found if finding.behind is None or finding in alternatives]


def judged(result: _R, more: Sequence[Finding]) -> _R:
    """Return a result with further findings, judged anew."""
    return result.model_copy(update=judgement([*complete(result).findings, *more])) if more else result


def about(finding: Finding, captures: Sequence[str]) -> Finding:
    """Return a finding about some of its captures alone."""
    each = {name: values for name, values in finding.each.items() if name in captures}
    values = {**finding.values, **next(iter(each.values()), {})}
    code = CODES[finding.code]
    found = finding.model_copy(update={"captures": list(captures), "each": each, "values": values})
    places = places_in(found)
    texts = {"text": code.said(places, captures, ENGLISH), "to_do": code.told_to_do(places, captures, ENGLISH)}
    return found.model_copy(update=texts)


def sentence_of(finding: Finding, language: Catalogue = ENGLISH) -> str:
    """Return what a finding says and what to do, as a warning."""
    return language.sentences([finding.text, finding.to_do])


def causes_of(findings: Iterable[Finding], language: Catalogue = ENGLISH) -> list[RootCause]:
    """Return the root causes: the remedies, told as their findings are."""
    return [_cause(finding, finding.remedy, language) for finding in findings if finding.remedy is not None]


def _cause(finding: Finding, remedy: RootCause, language: Catalogue) -> RootCause:
    code = CODES.get(finding.code)
    if code is None or not code.title:
        return remedy
    title = _filled(code, code.title, finding, language) or remedy.title
    return remedy.model_copy(update={"title": title, "sentence": sentence_of(finding, language)})


def reasons_of(findings: Iterable[Finding], language: Catalogue = ENGLISH) -> dict[str, str]:
    """Return by capture why it is not used, for findings whose codes have a reason."""
    found: dict[str, str] = {}
    for finding in findings:
        code = CODES.get(finding.code)
        for capture in finding.captures if code and code.reason else ():
            said = _filled(code, code.reason, finding, language, capture) if code else None
            if said is not None:
                found.setdefault(capture, said)
    return found


def places_in(finding: Finding, capture: str = "") -> dict[str, Value]:
    """Return a finding's values, or those of one of its captures, with messages as such."""
    values: dict[str, Value] = {**finding.values, **finding.each.get(capture, {})}
    for name in values:
        parts = finding.messages.get(f"{capture}:{name}", finding.messages.get(name))
        if parts is not None:
            values[name] = message_of(parts.to_json())
    return values


def _filled(code: Code, text: Choice, finding: Finding, language: Catalogue, capture: str = "") -> str | None:
    """Return one of a code's texts with a finding's values; None where another version stored other values."""
    captures = [capture] if capture else finding.captures
    try:
        if capture and language is ENGLISH:  # evidence shows it too, which is said in the reader's language
            return code.as_message(text, places_in(finding, capture), captures)
        return code.filled(text, places_in(finding, capture), captures, language)
    except (KeyError, ValueError):
        return None


def _hidden(found: list[Finding]) -> list[Finding]:
    """Return findings with those that only follow from others behind these."""
    codes = {finding.code: CODES.get(finding.code) for finding in found}
    root = next((f.code for f in found if (code := codes[f.code]) and code.explains_all), None)
    shown: list[Finding] = []
    for number, finding in enumerate(found):
        code = codes[finding.code]
        behind = next((name for name in (code.behind if code else ()) if name in codes), None)
        if root is not None and finding.severity != "note":
            first = next(k for k, one in enumerate(found) if one.code == root)
            behind = behind or (root if number != first else None)
        if behind is None and finding.behind in codes:
            behind = finding.behind
        shown.append(finding if behind == finding.behind else finding.model_copy(update={"behind": behind}))
    return shown
