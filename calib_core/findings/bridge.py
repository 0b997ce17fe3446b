"""Findings for what is said without one: by results and captures that were stored before 0.2."""

from collections.abc import Mapping
from typing import Any, TypeVar

from calib_core.findings.codes.stored import SAID_BEFORE, SAID_NOTE, SAID_WARNING
from calib_core.messages import ENGLISH
from calib_core.records import Measured, Result
from calib_core.records.findings import Finding

_R = TypeVar("_R", bound=Result)


def complete_measured(measured: Measured) -> Measured:
    """Return what was measured in a capture with a finding for what it says without one."""
    if measured.findings or measured.reason is None:
        return measured
    code = {"fail": SAID_BEFORE, "warn": SAID_WARNING}.get(measured.verdict, SAID_NOTE)
    sentence = ENGLISH.sentences([measured.reason, measured.to_do or ""])
    return measured.model_copy(update={"findings": [code([measured.capture], sentence=sentence)]})


def findings_in(data: Mapping[str, Any]) -> list[Finding]:
    """Return the findings of a result, given as JSON data."""
    told = {name: value for name, value in data.items() if name != "evidence"}
    return complete(Result.model_validate({"method": "", "software": "", "inputs_sha256": "", **told})).findings


def complete(result: _R) -> _R:
    """Return a result whose findings say all that its warnings, notes and causes say."""
    said = {ENGLISH.sentences([one.text, one.to_do]) for one in result.findings}
    remedies = {cause.sentence: cause for cause in result.causes}
    known = {one.remedy.id for one in result.findings if one.remedy is not None}
    verdict_said = not (said & {*result.warnings})
    more: list[Finding] = []
    for number, sentence in enumerate(result.warnings):
        if sentence in said:
            continue
        code = SAID_BEFORE if result.verdict == "fail" and number == 0 and verdict_said else SAID_WARNING
        cause = remedies.get(sentence)
        more.append(code(cause.captures if cause else (), remedy=cause, sentence=sentence))
        known |= {cause.id} if cause else set()
    more += [SAID_NOTE(sentence=sentence) for sentence in result.notes if sentence not in said]
    more += [
        SAID_NOTE(cause.captures, remedy=cause, sentence=cause.sentence)
        for cause in result.causes
        if cause.id not in known
    ]
    return result.model_copy(update={"findings": [*result.findings, *more]}) if more else result
