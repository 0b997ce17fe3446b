"""Findings as they are read: in a language, and with the severities of a cell."""

from collections.abc import Iterable, Mapping
from typing import Any

from calib_core.findings.bridge import complete, complete_measured
from calib_core.findings.catalogues import catalogue
from calib_core.findings.codes.provenance import NOT_REPLAYED
from calib_core.findings.judgement import causes_of, judgement, measured_judgement, places_in, reasons_of
from calib_core.findings.table import CODES
from calib_core.records import Measured, Result
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


def _of_provenance(result: Result) -> list[Finding]:
    """Return what is to be said of where a result comes from, which is not stored with it."""
    if result.provenance == "imported":
        return [NOT_REPLAYED()]
    noticed = (result.seal or {}).get("finding")
    return [] if noticed is None else [Finding.model_validate(noticed)]


def findings_as_read(
    findings: Iterable[Finding], language: str = "en", severities: Mapping[str, Severity] | None = None
) -> list[Finding]:
    """Return findings as they are read: in a language, with a cell's own severities, errors first."""
    return judgement(in_language(finding, language) for finding in with_severities(findings, severities))[
        "findings"
    ]


def measured_as_read(
    data: Mapping[str, Any], language: str = "en", severities: Mapping[str, Severity] | None = None
) -> dict[str, Any]:
    """Return what was measured in a capture, given as JSON data, as it is read."""
    if language == "en" and not severities and "findings" in data:
        return dict(data)
    stored = Measured.model_validate({"kind": "profile", **data})
    findings = findings_as_read(complete_measured(stored).findings, language, severities)
    told = measured_judgement(findings, catalogue(language))
    return {**data, **told, "findings": [finding.to_json() for finding in findings]}


def guide_as_read(data: Mapping[str, Any], language: str = "en") -> dict[str, Any]:
    """Return a guide, given as JSON data, with its findings and its last capture in a language."""
    found = findings_as_read(map(Finding.model_validate, data["findings"]), language)
    last = data["last_capture"]
    return {
        **data,
        "findings": [finding.to_json() for finding in found],
        "last_capture": None if last is None else measured_as_read(last, language),
    }


def as_read(
    data: Mapping[str, Any], language: str = "en", severities: Mapping[str, Severity] | None = None
) -> dict[str, Any]:
    """Return a result, given as JSON data, as it is read: in a language, and with a cell's own severities.

    What is stored, its key and what refuses an export or a release know nothing of either.
    """
    result = complete(Result.model_validate(data))
    findings = findings_as_read([*result.findings, *_of_provenance(result)], language, severities)
    said = catalogue(language)
    made = result.model_copy(update=judgement(findings, said)).model_dump(mode="json", include={*_MADE})
    made["findings"] = [finding.to_json() for finding in findings]
    read = {**data, **made}
    if language != "en" and data.get("residuals"):
        reasons = reasons_of(findings, said)
        read["residuals"] = [
            {**row, "reason": reasons.get(row["capture"]) or said.say(row.get("reason") or "") or None}
            for row in data["residuals"]
        ]
    return read
