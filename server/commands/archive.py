"""`scancell archive`: pack, unpack, verify and replay a session's archive."""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib_core.archive import archive
from calib_core.archive.archive import REPORT_FILE, SCENE_FILE, ArchiveFacts
from calib_core.archive.bag import Content
from calib_core.archive.folder import folder_of, load_session, to_json_bytes
from calib_core.archive.stored_results import stored_results
from calib_core.errors import CalibrationError
from calib_core.records import Session
from calib_core.review.replay import Replay, StageReplay
from calib_core.review.replay import replay as replay_session
from calib_core.stages.stage import ReadFile
from server.commands.progress import progress_bar
from server.commands.solving import solved_if_possible

_LISTED = 10


def pack(path: Path, out: Path, with_scene: bool) -> int:
    """Write a session's archive with its report and scene; a session without results is solved for it."""
    folder = folder_of(path)
    session, read = load_session(folder)
    extra: dict[str, Content] = {}
    results = stored_results(folder)
    if not results:
        results = solved_if_possible(session, read)
        extra |= {f"results/{stage}.json": to_json_bytes(result) for stage, result in results.items()}
    extra |= _report(session, read, results)
    if with_scene:
        extra |= _scene(session, read, results)
    print(f"{out}: {_facts(archive.pack(folder, out, extra))}")
    return 0


def unpack(file: Path, out: Path) -> int:
    """Write an archive's files as a folder, whose `data` is the session folder."""
    print(f"{out / 'data'}: {_facts(archive.unpack(file, out))}")
    return 0


def verify(file: Path) -> int:
    """Check an archive as a whole, and say what it holds."""
    print(f"{file}: whole and unaltered. {_facts(archive.verify(file))}")
    return 0


def replay(path: Path, as_json: bool) -> int:
    """Solve an archive afresh and compare; returns 1 where a number differs."""
    with archive.opened(path) as folder:
        session, read = load_session(folder)
        with progress_bar() as progress:
            found = replay_session(session, read, stored_results(folder), progress, str(path))
    if as_json:
        print(json.dumps(found.model_dump(mode="json"), ensure_ascii=False, allow_nan=False))
    else:
        print("\n".join(line for stage in found.stages for line in _stage_lines(stage, found)))
    return 0 if found.equal else 1


def _report(session: Session, read: ReadFile, results: Mapping[str, Mapping[str, Any]]) -> dict[str, Content]:
    from server.render.report.report import report_html
    from server.render.report.stale import stale_stages

    stale = stale_stages(session, read, results)
    for stage in stale:
        print(
            f"scancell: warning: the result of {stage} is older than its captures: `scancell run` solves it anew.",
            file=sys.stderr,
        )
    try:
        return {REPORT_FILE: report_html(session, results, stale).encode()}
    except CalibrationError as error:
        print(f"scancell: warning: packed without the report: {error}", file=sys.stderr)
        return {}


def _scene(session: Session, read: ReadFile, results: Mapping[str, Mapping[str, Any]]) -> dict[str, Content]:
    from server.jobs.measuring import measure
    from server.scenes.offline import scene_html
    from server.scenes.stored import scene_input

    try:
        measured = [measure(session, capture, read) for capture in session.captures]
        return {SCENE_FILE: scene_html(scene_input(session, read, measured, results)).encode()}
    except CalibrationError as error:
        print(f"scancell: warning: packed without the scene: {error}", file=sys.stderr)
        return {}


def _facts(facts: ArchiveFacts) -> str:
    verdicts = ", ".join(f"{stage} {verdict}" for stage, verdict in facts.results.items()) or "no results"
    size = f"{facts.files} files, {facts.payload_bytes / 1e6:.1f} MB"
    return f"{facts.session or 'session'}, {facts.captures} captures, {verdicts}; {size}"


def _stage_lines(stage: StageReplay, found: Replay) -> list[str]:
    if stage.equal:
        largest = f"largest difference {stage.largest_relative:.1e}" if stage.largest_relative else "bit for bit"
        return [f"{stage.stage}: equal ({stage.numbers} numbers, {largest}; tolerance {found.tolerance:g})"]
    head = f"{stage.stage}: DIFFERS"
    if stage.difference_count:
        head += f" in {stage.difference_count} values (tolerance {found.tolerance:g}, relative)"
    rows = [f"  {d.path}: {d.stored} stored, {d.fresh} now" for d in stage.differences[:_LISTED]]
    more = stage.difference_count - len(rows)
    return [head, *rows, *([f"  and {more} more (--json lists them)"] if more > 0 else []), *stage.why]
