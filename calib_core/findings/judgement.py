"""A judgement, made of findings once: verdict, warnings, notes, causes, and the captures' reasons."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, TypeVar

from calib_core.findings.bridge import complete
from calib_core.findings.code import Choice, Code, message_of
from calib_core.findings.table import CODES
from calib_core.messages import ENGLISH, Catalogue, Value
from calib_core.records import Result, RootCause, Verdict
from calib_core.records.findings import Finding

_ORDER: Final = ("error", "warning", "note")
_R = TypeVar("_R", bound=Result)


def verdict_of(findings: Iterable[Finding]) -> Verdict:
    """Return `fail` with an error, `warn` with a warning, else `pass`; what only follows does not count."""
    found = {finding.severity for finding in findings if finding.behind is None}
    return "fail" if "error" in found else "warn" if "warning" in found else "pass"


def has(findings: Iterable[Finding], *codes: Code) -> bool:
    """Return whether one of the codes is among the findings."""
    names = {code.name for code in codes}
    return any(finding.code in names for finding in findings)


def has_code(result: Mapping[str, Any], *codes: Code) -> bool:
    """Return whether a result, given as JSON data, has a finding of one of these codes."""
    names = {code.name for code in codes}
    return any(finding["code"] in names for finding in result.get("findings") or [])


def judgement(findings: Iterable[Finding]) -> dict[str, Any]:
    """Return the fields of a result that are made of its findings: errors first, then warnings, then notes.

    Within a severity they stay in their order: root causes first, and not what follows from them.
    """
    found = sorted(_hidden(list(findings)), key=lambda finding: _ORDER.index(finding.severity))
    shown = [finding for finding in found if finding.behind is None]
    return {
        "findings": found,
        "verdict": verdict_of(found),
        "warnings": [sentence_of(finding) for finding in shown if finding.severity != "note"],
        "notes": [sentence_of(finding) for finding in shown if finding.severity == "note"],
        "causes": causes_of(_told_with_causes(found)),
    }


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
    texts = {
        "text": code.said(places, captures, ENGLISH),
        "to_do": code.told_to_do(places, captures, ENGLISH),
    }
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
            values[name] = message_of(parts)
    return values


def _filled(code: Code, text: Choice, finding: Finding, language: Catalogue, capture: str = "") -> str | None:
    """Return one of a code's texts with a finding's values; None where another version stored other values."""
    try:
        return code.filled(text, places_in(finding, capture), [capture] if capture else finding.captures, language)
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
