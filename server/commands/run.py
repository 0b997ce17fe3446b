"""`scancell run`: solves a session folder or an archive, without a server."""

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib_core.disk import temporary_folder
from calib_core.messages import message
from server.console.command import NOT_ACCEPTED, OK, Command, session_argument
from server.console.output import print_result, remark

if TYPE_CHECKING:
    from calib_core.errors import CalibrationError
    from calib_core.messages import Catalogue
    from calib_core.records import ReadFile, Result, RootCause, Session
    from server.console.client import Scancell


def _arguments(parser: argparse.ArgumentParser) -> None:
    from calib_core.steps import stage_names

    session_argument(parser)
    stages = f"all (default), or one of {', '.join(stage_names())}"
    parser.add_argument("--stage", default="all", metavar="STAGE", help=stages)
    remedy = parser.add_mutually_exclusive_group()
    remedy.add_argument(
        "--apply",
        metavar="CAUSE",
        help="apply the remedy of a root cause (its id, or 1 for the likeliest), then solve",
    )
    remedy.add_argument("--undo", action="store_true", help="undo what --apply changed last, then solve")
    failing = "end with status 1 where a result has a finding of these codes, separated by commas"
    parser.add_argument("--fail-on", default="", metavar="CODE,…", help=failing)
    parser.add_argument("--out", type=Path, metavar="DIR", help="write results/ here instead of into the session")


def _run(options: argparse.Namespace) -> int:
    """Solve a session, store its results, print them; return 0 where all are accepted, else 1."""
    from calib_core.archive.archive import is_archive, opened
    from calib_core.archive.folder import folder_of, load_session, past_of, result_data
    from calib_core.archive.stored_results import truth_of
    from calib_core.errors import CalibrationError
    from calib_core.formats.shared.writing import write_pieces
    from calib_core.stages.evidence import text_of
    from calib_core.stages.pipeline import run
    from server.console.language import result_as_read, spoken
    from server.console.progress import progress_bar

    if options.server is not None:
        return _run_there(options)
    failing = _failing_codes(options)
    path: Path = options.session
    target = None if options.out is None and is_archive(path) else options.out or folder_of(path)

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        if target is not None:
            write_pieces(target / name, pieces)

    with opened(path) as folder:
        session, read = load_session(folder)
        if target is not None:
            past_of(target)  # a damaged one is told before hours of solving, not after
        with progress_bar(options) as progress:
            if options.apply or options.undo:
                session = _remedied(options, folder, session, read, in_place=target == folder)
            found: dict[str, Any] = {}
            try:
                results = run(session, read, options.stage, progress, store, found)
            except CalibrationError as error:
                if target is not None and found:  # what was solved before is not lost
                    _store(options, found, target, session)
                raise _with_remedy(error) from None
        truth = truth_of(folder)
    said = spoken(options)
    read_results = {name: result_as_read(result, said, session.cell.findings) for name, result in results.items()}
    told = {name: {**result_data(result), "provenance": "solved"} for name, result in read_results.items()}
    texts = [
        text
        for name, result in read_results.items()
        for text in (text_of(result, said), *_truth_text(session, told[name], truth, said))
    ]
    text = "\n\n".join([*texts, *_causes_text(options, read_results, said)])
    data = {"session": session.to_json(), "results": told}
    try:
        if target is not None:
            for name, stored in _store(options, results, target, session).items():
                told[name]["solved"] = stored["solved"]
    finally:  # stored before it is printed, which may fail, and printed where it cannot be stored
        print_result(options, text or message("Nothing to solve: cell.known gives every result."), data)
    if target is None:
        kept = message("{path} stays as it is: --out DIR writes the results to a folder.", path=path)
        remark(options, kept)
    return _status(failing, read_results)


def _failing_codes(options: argparse.Namespace) -> set[str]:
    """Return the codes of --fail-on; raises NotFoundError where one is none."""
    from calib_core.findings.table import code_named

    return {code_named(name.strip()).name for name in options.fail_on.split(",") if name.strip()}


def _status(failing: set[str], results: "Mapping[str, Result]") -> int:
    """Return whether all results are accepted: none fails, and none has a finding of these codes."""
    failed = any(result.verdict == "fail" for result in results.values())
    found = failing & {finding.code for result in results.values() for finding in result.findings}
    return NOT_ACCEPTED if failed or found else OK


def _remedied(
    options: argparse.Namespace, folder: Path, session: "Session", read: "ReadFile", *, in_place: bool
) -> "Session":
    """Return the session with a root cause's remedy applied, or undone; in its own folder it is stored so."""
    from calib_core.archive.applied import note_applied, undone
    from calib_core.causes.apply import applied, cause_named

    if options.undo:
        return undone(folder, session)
    cause = cause_named(_causes(options, folder, session, read), options.apply)
    if cause.changes is None:
        remark(options, message("nothing to apply: {sentence}", sentence=cause.sentence))
        return session
    changed, undo = applied(session, cause.changes)
    remark(options, message("applied: {title}. --undo undoes it.", title=cause.title))
    if in_place:
        note_applied(folder, changed, cause, undo)
    return changed


def _causes(options: argparse.Namespace, folder: Path, session: "Session", read: "ReadFile") -> "list[RootCause]":
    """Return the root causes that fresh results name, or that solving the session finds."""
    from calib_core.archive.folder import load_results, result_data
    from calib_core.causes.session import session_causes
    from calib_core.errors import CalibrationError
    from calib_core.graph.keys import Graph
    from calib_core.stages.pipeline import run

    stored = load_results(folder)
    found = session_causes(session, read, stored, Graph.of_files(session, read).stale(stored))
    if found:
        return found
    try:
        results = run(session, read, options.stage)
    except CalibrationError:
        return session_causes(session, read, {})
    return session_causes(session, read, {stage: result_data(result) for stage, result in results.items()})


def _with_remedy(error: "CalibrationError") -> "CalibrationError":
    """Return why a session cannot be solved at all, with how the likeliest cause is mended where one is found."""
    from calib_core.findings import causes_of

    for cause in causes_of(error.findings)[:1]:
        return error.adding(
            message("{sentence} Do so by --apply {found}.", sentence=cause.sentence, found=cause.id)
        )
    return error


def _truth_text(
    session: "Session", result: Mapping[str, Any], truth: Mapping[str, Any] | None, said: "Catalogue"
) -> list[str]:
    """Return a simulated cell's result beside its truth."""
    from calib_core.evidence.text import blocks_text
    from calib_core.findings.telling import block_in
    from calib_core.review.truth import truth_blocks

    blocks = [] if truth is None else truth_blocks(session, result, truth)
    return [blocks_text([block_in(block, said) for block in blocks], said=said)] if blocks else []


def _causes_text(options: argparse.Namespace, results: "Mapping[str, Result]", said: "Catalogue") -> list[str]:
    """Return how the root causes' remedies are applied."""
    lines = [
        f"  {cause.title}: scancell run {options.session} --apply {cause.id}"
        for result in results.values()
        for cause in result.causes
        if cause.changes is not None
    ]
    return ["\n".join([said.say(message("Remedies")), *dict.fromkeys(lines)])] if lines else []


def _run_there(options: argparse.Namespace) -> int:
    """Solve a session on the server, where a folder or archive is sent to first; print its results."""
    from calib_core.archive.folder import result_data, write_result
    from calib_core.archive.stored_results import result_record
    from calib_core.records import parse_session
    from calib_core.stages.evidence import text_of
    from server.console.language import result_as_read, spoken
    from server.console.progress import progress_bar
    from server.console.remote import connected, session_id

    if options.apply or options.undo:
        from calib_core.errors import InputError

        to_do = message("Apply it on the page, or to the session's folder.")
        raise InputError("--server alone", "--apply or --undo with it", to_do, "--server")
    failing = _failing_codes(options)
    with connected(options) as api, progress_bar(options, says_why=False) as progress:
        session = (
            _sent(api, options.session) if options.session.exists() else session_id(api, str(options.session))
        )
        progress(0.1, f"solving {options.stage} of session {session}")
        api.solve(session, options.stage)
        found: dict[str, Any] = api.solves_list_results(session)
        record = api.sessions_get(session)
    results = {stage: result_record(stage).model_validate(result) for stage, result in found.items()}
    if options.stage != "all":
        results = {options.stage: results[options.stage]}
    out: Path | None = options.out
    if out is not None:
        for stage, result in results.items():
            write_result(out, stage, result, parse_session(record))
    said, severities = spoken(options), parse_session(record).cell.findings
    text = "\n\n".join(text_of(result_as_read(result, said, severities), said) for result in results.values())
    data = {"session": record, "results": {name: result_data(result) for name, result in results.items()}}
    print_result(options, f"session {session}\n\n{text}", data)
    return _status(failing, results)


def _sent(api: "Scancell", path: Path) -> str:
    """Send a session folder or archive to the server; return its id there."""
    from calib_core.archive.archive import is_archive, pack

    with temporary_folder() as folder:
        archive = path
        if not is_archive(path):
            archive = folder / "session.zip"
            pack(path, archive)
        return str(api.archives_import_archive(archive.read_bytes())["id"])


def _store(
    options: argparse.Namespace, results: Mapping[str, "Result"], folder: Path, session: "Session"
) -> dict[str, dict[str, Any]]:
    """Write the results, and return them as they are stored; a read-only session folder is told, and no error."""
    from calib_core.archive.folder import write_result
    from calib_core.errors import InputError

    stored: dict[str, dict[str, Any]] = {}
    try:
        for stage, result in results.items():
            stored[stage] = write_result(folder, stage, result, session)
    except InputError as error:
        if options.out is not None:
            raise
        remark(options, message("Warning: the results are not stored: {error} (or use --out DIR)", error=error))
    return stored


COMMAND = Command(
    "run", "solve a session folder or archive, no server needed", "session", _arguments, _run, uses_server=True
)
