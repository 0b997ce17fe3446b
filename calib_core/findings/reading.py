"""Findings as they are read: in a language, and with the severities of a cell."""

from collections.abc import Iterable, Mapping
from typing import Any

from calib_core.findings.bridge import complete
from calib_core.findings.catalogues import catalogue
from calib_core.findings.judgement import causes_of, judgement, places_in, reasons_of
from calib_core.findings.table import CODES
from calib_core.records import Result
from calib_core.records.findings import Finding, Severity

_MADE = ("findings", "verdict", "warnings", "notes", "causes")


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


def with_severities(findings: Iterable[Finding], severities: Mapping[str, Severity] | None) -> list[Finding]:
    """Return findings with a cell's own severities; those of codes that are fixed stay."""
    return [_changed(finding, severities or {}) for finding in findings]


def _changed(finding: Finding, severities: Mapping[str, Severity]) -> Finding:
    code, wanted = CODES.get(finding.code), severities.get(finding.code)
    if wanted is None or code is None or code.fixed:
        return finding
    return finding.model_copy(update={"severity": wanted})


def as_read(
    data: Mapping[str, Any], language: str = "en", severities: Mapping[str, Severity] | None = None
) -> dict[str, Any]:
    """Return a result, given as JSON data, as it is read: in a language, and with a cell's own severities.

    What is stored, its key and what refuses an export or a release know nothing of either.
    """
    result = complete(Result.model_validate(data))
    findings = [in_language(finding, language) for finding in with_severities(result.findings, severities)]
    made = result.model_copy(update=judgement(findings)).model_dump(mode="json", include={*_MADE})
    made["findings"] = [finding.to_json() for finding in judgement(findings)["findings"]]
    read = {**data, **made}
    reasons = reasons_of(findings, catalogue(language)) if language != "en" else {}
    if reasons:
        read["residuals"] = [
            {**row, "reason": reasons.get(row["capture"], row.get("reason"))}
            for row in data.get("residuals") or []
        ]
    return read
