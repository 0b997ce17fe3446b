"""Where results come from: replayed where no seal proves it, and compared with what stands beside them."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from calib_core import __version__
from calib_core.archive.archive import REPORT_FILE, ArchiveFacts, read_archive
from calib_core.archive.archive import verify as verify_alone
from calib_core.archive.bag import Bag, BagSource, open_bag
from calib_core.archive.bag_zip import LIMITS, ArchiveLimits
from calib_core.archive.dates import ANSWER_FILE
from calib_core.archive.folder import HISTORY_FILE, parse_json
from calib_core.archive.seals import IMPORTED, has_origin, is_origin, seal_state
from calib_core.errors import CalibrationError
from calib_core.exports.answer import answer_of
from calib_core.findings.codes.circumstances import CERTIFICATE_OVERDUE
from calib_core.findings.codes.faults import FAULT_CODES
from calib_core.findings.codes.provenance import (
    ARCHIVE_DISAGREES,
    NOT_REPLAYED,
    REPLAY_DIFFERS,
    REPLAYED_OTHER_REVISION,
    SEAL_BROKEN,
)
from calib_core.graph.keys import Graph
from calib_core.records import Progress, ReadFile, ResultsData, Session
from calib_core.records.faults import OF_RESULTS
from calib_core.records.findings import Finding
from calib_core.review.answer import answer_record
from calib_core.review.printed import misprinted
from calib_core.review.replay import replay
from calib_core.review.same_numbers import WORDS, StageReplay
from calib_core.steps import table_stages, tool_stages

_OF_MOMENT: Final = ("decided_before", "faults")  # by who was asked, and when
_OF_MOMENT_CODES: Final = {
    *(code.name for code in FAULT_CODES.values()), CERTIFICATE_OVERDUE.name,
    NOT_REPLAYED.name, REPLAY_DIFFERS.name, REPLAYED_OTHER_REVISION.name,
}  # fmt: skip
_OF_BAG: Final = (*OF_RESULTS, "verify-fail")
_LATER: Final = ("findings", "verified", "decided_before", "equipment")  # answers of 0.1.0 lack them
_EQUAL: Final = 1e-6
_EQUAL_COVARIANCE: Final = 1e-4


def replayed(
    session: Session, read: ReadFile, results: ResultsData, progress: Progress | None = None
) -> dict[str, dict[str, Any]]:
    """Return results, given as JSON data, with those of the answer solved anew whose provenance no seal proves.

    Numbers stay as they are stored; only what is said of them changes.
    """
    of_answer = {*tool_stages(), *table_stages(), "verify"}
    asked = {stage: r for stage, r in results.items() if stage in of_answer and r.get("provenance") == IMPORTED}
    found = {stage: dict(result) for stage, result in results.items()}
    if asked:
        fresh: dict[str, dict[str, Any]] = {}
        for one in replay(session, read, asked, progress, fresh=fresh.__setitem__).stages:
            found[one.stage] = after_replay(results[one.stage], one, fresh.get(one.stage, {}))
    return found


def after_replay(stored: Mapping[str, Any], found: StageReplay, fresh: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stored result as it is by its replay: with its provenance and, where nobody signed it, new words.

    Words (evidence, warnings) are not compared, as versions put them otherwise: they are those of the replay.
    """
    if found.provenance is None:
        return dict(stored)
    result, state = {**stored, "provenance": found.provenance}, seal_state(stored)
    if found.equal and state is None:
        result |= {name: fresh[name] for name in WORDS if name in fresh}
    elif state is False:  # its numbers are right; what no replay gives, as when it was solved, may not be
        broken = SEAL_BROKEN([], what=f"results/{found.stage}.json")
        result["findings"] = [broken.to_json(), *stored.get("findings", ())]
    return result


def verify(source: BagSource, where: str = "", limits: ArchiveLimits = LIMITS) -> ArchiveFacts:
    """Check an archive as a whole, its seal, and that answer, history and report agree with its results.

    Raises
    ------
    CalibrationError
        With the first thing that is wrong with the archive itself.
    """
    facts = verify_alone(source, where, limits)
    with open_bag(source, where, limits) as bag:
        archived = read_archive(bag)
        findings = [*facts.findings, *_disagreeing(bag, archived.session, archived.results)]
    return facts.model_copy(update={"findings": findings})


def _disagreeing(bag: Bag, session: Session, results: ResultsData) -> Iterator[Finding]:
    """Give what stands in an archive beside its results and says something else."""
    graph = Graph(session, bag.sha256)
    try:
        dates = (results.get(stage, {}).get("solved") for stage in (*tool_stages(), *table_stages()))
        solved = next((str(date) for date in dates if date), "")
        answer = answer_record(answer_of(session, results, graph.stale(results), solved)).to_json()
    except CalibrationError:
        answer = None
    fields: dict[str, list[str]] = {}
    if ANSWER_FILE in bag.payload and answer is not None:
        fields[ANSWER_FILE] = answer_fields(bag.read(ANSWER_FILE), answer)
    if REPORT_FILE in bag.payload:
        fields[REPORT_FILE] = list(misprinted(bag.read(REPORT_FILE), session, results, answer))
    for name, others in fields.items():
        if others:
            yield ARCHIVE_DISAGREES([], what=name, fields=", ".join(others[:5]))
    if HISTORY_FILE in bag.payload:
        yield from _history(bag, results)


def answer_fields(content: bytes, answer: Mapping[str, Any]) -> list[str]:
    """Return the fields of an archive's answer that its results do not give."""
    told = parse_json(content, ANSWER_FILE)
    if not isinstance(told, dict):
        return [ANSWER_FILE]
    unknown = {
        "solved": answer["solved"] is None
    }  # results of earlier versions, and of the command line, tell none
    if answer["verdict"] == "fail":
        unknown["workpiece_sigma_mm"] = True  # earlier versions stated it
    if answer["software"] != f"scancell {__version__}":
        unknown["budget"] = True  # another version's method
    fields = [n for n in answer if not unknown.get(n) and n not in _OF_MOMENT and (n in told or n not in _LATER)]
    return [n for n in fields if not _same(_lasting(n, told.get(n)), _lasting(n, answer[n]), n)] + _faults(
        told, answer
    )


def _lasting(name: str, value: Any) -> Any:
    """Return a field of an answer without the findings of the moment in which somebody asked for it."""
    if name != "findings" or not isinstance(value, list):
        return value
    return [one for one in value if not isinstance(one, dict) or one.get("code") not in _OF_MOMENT_CODES]


def _faults(told: Mapping[str, Any], answer: Mapping[str, Any]) -> list[str]:
    """Return "faults" where those that results decide are others, or one is none."""
    said = told.get("faults")
    if not isinstance(said, list) or not all(one in FAULT_CODES for one in said):
        return ["faults"]
    return [] if all((one in said) == (one in answer["faults"]) for one in _OF_BAG) else ["faults"]


def _same(a: Any, b: Any, name: str = "") -> bool:
    """Return whether two values of an answer are the same, numbers but for their rounding."""
    if name == "covariance" and a is not None and b is not None:
        return _same_covariance(a, b)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return all(_same(a.get(key), b[key], key) for key in b if key in a or b[key])
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, bool) or isinstance(b, bool):
        return a is b
    if isinstance(a, float) or isinstance(b, float):
        within = _EQUAL_COVARIANCE if "sigma" in name else _EQUAL
        return (
            isinstance(a, int | float)
            and isinstance(b, int | float)
            and math.isclose(a, b, rel_tol=within, abs_tol=1e-9)
        )
    return a == b


def _same_covariance(a: Any, b: Any) -> bool:
    """Return whether two covariances are the same to a part of their variances, as processors round."""
    try:
        one, other = np.array(a, dtype=float), np.array(b, dtype=float)
        sigmas = np.sqrt(np.abs(np.diag(other)))
        within = _EQUAL_COVARIANCE * np.outer(sigmas, sigmas)
        return one.shape == other.shape and bool(np.all(np.isclose(one, other, 0, within, equal_nan=True)))
    except (TypeError, ValueError):
        return False


def _history(bag: Bag, results: ResultsData) -> Iterator[Finding]:
    """Give the results of an archive's past that are not what was signed, and a past that is of other results."""
    data = parse_json(bag.read(HISTORY_FILE), HISTORY_FILE)
    past: list[Any] = data.get("results") or [] if isinstance(data, dict) else []
    for number, one in enumerate(past):
        record = one.get("record") or results.get(one.get("stage"))
        if record is None:
            yield ARCHIVE_DISAGREES([], what=HISTORY_FILE, fields=f"results[{number}].stage")
            continue
        origin, seal = one.get("solved_from") or {}, record.get("seal") or {}
        is_known = has_origin(seal) or (origin.get("session") and seal.get("session"))
        if seal_state(record) is False or (is_known and not (origin.get("session") and is_origin(origin, seal))):
            yield SEAL_BROKEN([], what=f"{HISTORY_FILE}: results[{number}]")
