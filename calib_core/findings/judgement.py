"""A judgement, made of findings once: verdict, warnings, notes, causes, and the captures' reasons."""

from collections.abc import Iterable, Sequence
from typing import Any, Final, TypeVar

from calib_core.findings.bridge import complete
from calib_core.findings.code import Code, message_of
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


def judgement(findings: Iterable[Finding]) -> dict[str, Any]:
    """Return the fields of a result that are made of its findings: errors first, then warnings, then notes.

    Within a severity they stay in their order: root causes first, and not what follows from them.
    """
    found = list(findings)
    codes = {finding.code for finding in found}
    hidden = [_hidden(finding, codes) for finding in found]
    found = sorted(hidden, key=lambda finding: _ORDER.index(finding.severity))
    shown = [finding for finding in found if finding.behind is None]
    return {
        "findings": found,
        "verdict": verdict_of(found),
        "warnings": [sentence_of(finding) for finding in shown if finding.severity != "note"],
        "notes": [sentence_of(finding) for finding in shown if finding.severity == "note"],
        "causes": causes_of(shown),
    }


def judged(result: _R, more: Sequence[Finding]) -> _R:
    """Return a result with further findings, judged anew."""
    return result.model_copy(update=judgement([*complete(result).findings, *more])) if more else result


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
    title = filled(code.title, finding, language) or remedy.title
    return remedy.model_copy(update={"title": title, "sentence": sentence_of(finding, language)})


def reasons_of(findings: Iterable[Finding], language: Catalogue = ENGLISH) -> dict[str, str]:
    """Return by capture why it is not used, for findings whose codes have a reason."""
    found: dict[str, str] = {}
    for finding in findings:
        code = CODES.get(finding.code)
        for capture in finding.captures if code and code.reason else ():
            said = filled(code.reason, finding, language, capture) if code else None
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


def filled(text: str, finding: Finding, language: Catalogue, capture: str = "") -> str | None:
    """Return a text filled with a finding's values; None where another version stored it, with other values."""
    try:
        return language.fill(text, places_in(finding, capture))
    except (KeyError, ValueError):
        return None


def _hidden(finding: Finding, codes: set[str]) -> Finding:
    code = CODES.get(finding.code)
    cause = next((name for name in (code.behind if code else ()) if name in codes), None)
    return finding if cause == finding.behind else finding.model_copy(update={"behind": cause})
