"""Where results come from: replayed where no seal proves it, and compared with what stands beside them."""

import html
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from calib_core.archive.archive import REPORT_FILE, ArchiveFacts, read_archive
from calib_core.archive.archive import verify as verify_alone
from calib_core.archive.bag import Bag, BagSource, open_bag
from calib_core.archive.bag_zip import LIMITS, ArchiveLimits
from calib_core.archive.dates import ANSWER_FILE
from calib_core.archive.folder import parse_json
from calib_core.archive.seals import IMPORTED, seal_state, session_sha256
from calib_core.cell.found import SCANNER_FRAMES
from calib_core.errors import CalibrationError
from calib_core.exports.answer import answer_of
from calib_core.findings.codes.provenance import ARCHIVE_DISAGREES, SEAL_BROKEN
from calib_core.graph.keys import Graph
from calib_core.records import Session
from calib_core.records.callbacks import Progress, ReadFile
from calib_core.records.findings import Finding
from calib_core.review.answer import answer_record
from calib_core.review.replay import WORDS, StageReplay, replay
from calib_core.steps import table_stages, tool_stages

HISTORY_FILE: Final = "history.json"
_TOLD_OF_THE_MOMENT: Final = (
    "faults", "findings", "solved", "verified", "warnings", "budget", "undetermined", "decided_before",
    "equipment", "stale",
)  # fmt: skip
_EQUAL: Final = 1e-6


def replayed(
    session: Session,
    read: ReadFile,
    results: Mapping[str, Mapping[str, Any]],
    progress: Progress | None = None,
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
    result = {**stored, "provenance": found.provenance}
    if found.equal and seal_state(stored) is None:
        result |= {name: fresh[name] for name in WORDS if name in fresh}
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


def _disagreeing(bag: Bag, session: Session, results: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Give what stands in an archive beside its results and says something else."""
    graph = Graph(session, bag.sha256)
    try:
        answer = answer_record(answer_of(session, results, graph.stale(results))).to_json()
    except CalibrationError:
        answer = None
    checks = {ANSWER_FILE: _answer_fields, REPORT_FILE: _report_fields}
    for name, fields_of in checks.items():
        if name in bag.payload and answer is not None:
            fields = fields_of(bag.read(name), answer)
            if fields:
                yield ARCHIVE_DISAGREES([], what=name, fields=", ".join(fields[:5]))
    if HISTORY_FILE in bag.payload:
        yield from _history(bag, results)


def _answer_fields(content: bytes, answer: Mapping[str, Any]) -> list[str]:
    """Return the fields of an archive's answer that its results do not give."""
    told = parse_json(content, ANSWER_FILE)
    if not isinstance(told, dict):
        return [ANSWER_FILE]
    of_failed = ("workpiece_sigma_mm",) if answer["verdict"] == "fail" else ()  # earlier versions stated it
    fields = [name for name in told if name in answer and name not in (*_TOLD_OF_THE_MOMENT, *of_failed)]
    return [name for name in fields if not _same(told[name], answer[name])]


def _same(a: Any, b: Any) -> bool:
    """Return whether two values of an answer are the same, numbers but for their rounding."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return all(_same(a[name], b[name]) for name in a if name in b)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) or isinstance(b, float):
        return (
            isinstance(a, int | float)
            and isinstance(b, int | float)
            and math.isclose(a, b, rel_tol=_EQUAL, abs_tol=1e-12)
        )
    return a == b


def _report_fields(content: bytes, answer: Mapping[str, Any]) -> list[str]:
    """Return the frames whose position a report does not print as its archive's results have it."""
    text = html.unescape(re.sub(r"<[^>]*>", " ", content.decode(errors="replace"))).replace("\N{MINUS SIGN}", "-")
    frames = (*SCANNER_FRAMES, "base_from_turntable")
    return [name for name in frames if answer.get(name) and not _prints(text, answer[name]["numbers"][:3])]


def _prints(text: str, numbers: list[float]) -> bool:
    """Return whether three numbers stand in a text one soon after the other, with equally many decimals."""
    for decimals in range(7):
        shown = [rf"(?<![\d.]){re.escape(f'{number:.{decimals}f}')}(?!\.?\d)" for number in numbers]
        if re.search(r"[\s\S]{0,200}?".join(shown), text):
            return True
    return False


def _history(bag: Bag, results: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Give the results of an archive's past that are not what was signed, and a past that is of other results."""
    data = parse_json(bag.read(HISTORY_FILE), HISTORY_FILE)
    past: list[Any] = data.get("results") or [] if isinstance(data, dict) else []
    for number, one in enumerate(past):
        record = one.get("record") or results.get(one.get("stage"))
        if record is None:
            yield ARCHIVE_DISAGREES([], what=HISTORY_FILE, fields=f"results[{number}].stage")
            continue
        origin = (one.get("solved_from") or {}).get("session")
        signed = (record.get("seal") or {}).get("session")
        if seal_state(record) is False or (origin and signed and session_sha256(origin) != signed):
            yield SEAL_BROKEN([], what=f"{HISTORY_FILE}: results[{number}]")
