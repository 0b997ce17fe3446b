"""The bridge to sentences: findings for what a result says without one.

It stays for results of releases before 0.2, which have no findings.  For the stages of today it leaves piece by
piece: `tests/core/findings_to_convert.py` lists the files that still build sentences.
"""

from typing import TypeVar

from calib_core.findings.codes.stored import SAID_BEFORE, SAID_NOTE, SAID_WARNING
from calib_core.messages import ENGLISH
from calib_core.records import Result
from calib_core.records.findings import Finding

_R = TypeVar("_R", bound=Result)


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
