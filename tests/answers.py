"""What small sessions are answered, kept beside the tests: ``python -m tests.answers [NAME ...]`` writes it anew.

A change of the code that moves a number, a verdict or a sentence of these shows in `tests/core/test_answers.py`.
"""

import gzip
import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from calib_core.archive.folder import result_data
from calib_core.captures.measure import measure_capture
from calib_core.causes.session import session_causes
from calib_core.errors import CalibrationError
from calib_core.findings import sentence_of
from calib_core.guidance.solved_cell import solved_cell
from calib_core.guidance.solved_plan import planned_captures
from calib_core.records import Session
from calib_core.review.answer import answer_of_folder
from calib_core.review.cell_frames import session_frames
from calib_core.review.check import check_session
from calib_core.simulation import simulate
from calib_core.stages.evidence import html_of, text_of
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import run

Files = Mapping[str, bytes]
KEPT: Final = Path(__file__).parent / "releases" / "answers"
SEED: Final = 7
SIMULATED: Final = (
    "tcp",
    "tcp-spoiled",
    "tcp-unknown-sigmas",
    "tcp-moved-sphere",
    "tcp-wrong-pose",
    "tcp-mixed",
    "tcp-sweep",
    "fixed-scanner-spoiled",
    "turntable",
    "turntable-wobble",
    "turntable-encoder-scale",
    "turntable-mixed-mounts",
    "turntable-partial",
    "two-scanners-that-err",
    "scanners-on-flange-and-base",
    "plate-distances",
    "rail",
    "gantry-turntable",
    "tcp-clouds",
    "tcp-metres",
    "turntable-reversed",
    "verify",
    "laser-plane",
    "camera-charuco",
    "ball",
)
WITH_PAGES: Final = ("tcp-spoiled", "turntable-wobble", "verify", "ball", "laser-plane")
WITH_ANSWER: Final = ("gantry-turntable", "tcp-clouds", "turntable-reversed", "verify", "laser-plane", "ball")
_NOT_KEPT: Final = (
    *("evidence", "inputs_sha256", "software", "solved", "verified", "provenance", "seal", "said"),
)
_NEGATIVE_ZERO: Final = re.compile(r"-(?=0(?:\.0+)?(?![\d.]))")


def sessions() -> dict[str, Callable[[], tuple[Session, Files]]]:
    """Return what makes each session, by name."""
    return {name: lambda name=name: _of(simulate(name, SEED)) for name in SIMULATED}


def answers(name: str) -> dict[str, Any]:
    """Return all that one session is answered, as JSON data."""
    session, files = sessions()[name]()
    measured = [measure_capture(session, capture, files.__getitem__) for capture in session.captures]
    found = check_session(session, files.__getitem__, {one.capture: one for one in measured})
    told: dict[str, Any] = {"check": [sentence_of(finding) for finding in found]}
    few = session.model_copy(update={"captures": session.captures[:6]})
    told["first"] = guide(few, measured[:6], {}).model_dump(mode="json")
    told["before"] = guide(session, measured, {}).model_dump(mode="json")
    try:
        results = run(session, files.__getitem__)
    except CalibrationError as error:
        causes = [cause.model_dump(mode="json") for cause in session_causes(session, files.__getitem__, {})]
        return told | {"refused": str(error), "causes": causes}
    told["after"] = guide(session, measured, results).model_dump(mode="json")
    whole = {stage: result_data(result) for stage, result in results.items()}
    told["results"] = {stage: _kept(result) for stage, result in whole.items()}
    told["texts"] = {stage: text_of(result) for stage, result in results.items()}
    if name in WITH_ANSWER:
        told["frames"] = _kept(session_frames(session, whole).model_dump(mode="json"))
    if name in WITH_ANSWER and (answer := answer_of_folder(session, whole, files.__getitem__)) is not None:
        told["answer"] = _kept(answer.model_dump(mode="json"))
    if name in WITH_PAGES:
        told["pages"] = {stage: html_of(result).partition("</style>")[2] for stage, result in results.items()}
    known = solved_cell(session, measured, told["results"])
    if known is not None:
        told["planned"] = [
            str(shot.pose.matrix.round(3).tolist()) for shot in planned_captures(known, 2, on_axes=False)
        ]
    return told


def _of(made: Any) -> tuple[Session, Files]:
    return made.session, made.files


def _kept(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _kept(one) for key, one in value.items() if key not in _NOT_KEPT}
    return [_kept(one) for one in value] if isinstance(value, list) else value


def plain(value: Any) -> Any:
    """Return JSON data with numbers of seven digits, and texts without the sign of a zero."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [plain(one) for one in value]
    if isinstance(value, str):
        return _NEGATIVE_ZERO.sub("", value)
    return float(f"{value:.7g}") if isinstance(value, float) else value


def leaves(value: Any, path: str = "", field: str = "") -> Iterator[tuple[str, str, Any]]:
    """Give every value with its path, and with that of its field: numbers of one are of one size."""
    if isinstance(value, dict):
        for key, one in value.items():
            yield from leaves(one, f"{path}.{key}", f"{field}.{key}")
    elif isinstance(value, list):
        for number, one in enumerate(value):
            yield from leaves(one, f"{path}[{number}]", field)
    else:
        yield path, field, value


def differences(then: Any, now: Any) -> list[str]:
    """Return what differs: numbers by a ten-thousandth of the largest of their field, all else by anything."""
    before, after = ({path: (field, value) for path, field, value in leaves(one)} for one in (then, now))
    largest: dict[str, float] = {}
    for field, value in before.values():
        if isinstance(value, float):
            largest[field] = max(largest.get(field, 0.0), abs(value))
    found = [f"{path}: there or not" for path in before.keys() ^ after.keys()]
    for path in before.keys() & after.keys():
        (field, a), (_, b) = before[path], after[path]
        is_near = isinstance(a, float) and isinstance(b, int | float) and abs(a - b) <= 1e-4 * largest[field]
        if a != b and not is_near:
            found.append(f"{path}: {a!r:.300} was kept, {b!r:.300} came")
    return sorted(found)


def kept(name: str) -> Any:
    """Return what was kept of a session."""
    return json.loads(gzip.decompress(_file(name).read_bytes()))


def write(name: str) -> None:
    """Keep what a session is answered now."""
    data = json.dumps(plain(answers(name)), ensure_ascii=False, sort_keys=True, indent=0)
    KEPT.mkdir(exist_ok=True)
    _file(name).write_bytes(gzip.compress(data.encode("utf-8"), mtime=0))


def _file(name: str) -> Path:
    return KEPT / f"{re.sub('[^a-z0-9]+', '-', name.lower()).strip('-')}.json.gz"


if __name__ == "__main__":
    for one in sys.argv[1:] or sessions():
        write(one)
