"""Findings as they are read: in a language, and with the severities of a cell."""

from collections.abc import Mapping
from typing import Any, TypeVar

from calib_core.findings.catalogues import catalogue
from calib_core.findings.judgement import causes_of, judgement, places_in, reasons_of
from calib_core.findings.table import CODES
from calib_core.records import Result
from calib_core.records.findings import Finding, Severity

_R = TypeVar("_R", bound=Result)


def in_language(finding: Finding, language: str) -> Finding:
    """Return a finding whose texts are in a language; as it is stored where its code is not known."""
    code, said = CODES.get(finding.code), catalogue(language)
    if code is None or language == "en":
        return finding
    values = places_in(finding)
    try:
        told: dict[str, Any] = {
            "text": code.said(values, finding.captures, said),
            "to_do": code.told_to_do(values, finding.captures, said),
        }
    except (KeyError, ValueError):  # stored by another version, with other values
        return finding
    if finding.remedy is not None:
        told["remedy"] = causes_of([finding.model_copy(update=told)], said)[0]
    return finding.model_copy(update=told)


def with_severities(result: _R, severities: Mapping[str, Severity] | None) -> _R:
    """Return a result as a cell wants it read: with its own severities, and the verdict that follows.

    What is fixed stays; the stored result, its key and what refuses an export or a release know nothing of it.
    """
    if not severities or not any(finding.code in severities for finding in result.findings):
        return result
    return result.model_copy(update=judgement(_changed(finding, severities) for finding in result.findings))


def _changed(finding: Finding, severities: Mapping[str, Severity]) -> Finding:
    code, wanted = CODES.get(finding.code), severities.get(finding.code)
    if wanted is None or code is None or code.fixed:
        return finding
    return finding.model_copy(update={"severity": wanted})


def result_in_language(result: _R, language: str) -> _R:
    """Return a result whose findings, warnings, notes, causes and reasons are in a language."""
    if language == "en":
        return result
    findings = [in_language(finding, language) for finding in result.findings]
    told = judgement(findings)
    rows = getattr(result, "residuals", None)
    if rows:
        reasons = reasons_of(findings, catalogue(language))
        told["residuals"] = [
            row.model_copy(update={"reason": reasons[row.capture]}) if row.capture in reasons else row
            for row in rows
        ]
    return result.model_copy(update=told)
