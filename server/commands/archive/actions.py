"""`scancell archive`: pack, unpack, verify and replay a session's archive."""

import argparse
from pathlib import Path

from calib_core.archive import archive
from calib_core.archive.archive import REPORT_FILE, SCENE_FILE, ArchiveFacts
from calib_core.archive.bag import Content
from calib_core.archive.dates import ANSWER_FILE, solved_when
from calib_core.archive.folder import folder_of, load_session, past_of, to_json_bytes
from calib_core.archive.seals import signed_result
from calib_core.archive.stored_results import stored_results, truth_of
from calib_core.counted import captures, files
from calib_core.disk import temporary_folder
from calib_core.errors import CalibrationError, InputError
from calib_core.findings import in_language
from calib_core.messages import message
from calib_core.moment import now
from calib_core.records import ReadFile, ResultsData, Session
from calib_core.review.answer import answer_of_folder
from calib_core.review.decided_before import decided_before_in
from calib_core.review.provenance import verify as verify_archive
from calib_core.review.replay import Replay
from calib_core.review.replay import replay as replay_session
from calib_core.review.same_numbers import StageReplay
from server.console.command import NOT_ACCEPTED, OK
from server.console.language import spoken
from server.console.output import input_name, is_stream, print_result, remark, write_out
from server.console.progress import progress_bar
from server.console.remote import connected
from server.console.solving import solved_if_possible

_LISTED = 10


def pack(options: argparse.Namespace) -> int:
    """Write a session's archive with its report and scene; a session without results is solved for it."""
    folder = folder_of(options.session)
    session, read = load_session(folder)
    extra: dict[str, Content] = {}
    results = stored_results(folder)
    if not results:
        results = {
            stage: signed_result(result, session)
            for stage, result in solved_if_possible(options, session, read).items()
        }
        extra |= {f"results/{stage}.json": to_json_bytes(result) for stage, result in results.items()}
        date = now()
    else:
        date = solved_when(folder, results, unpacked=False)
    extra |= _report(options, folder, session, read, results, date)
    before = decided_before_in(past_of(folder), session, results)
    answer = answer_of_folder(session, results, read, date, decided_before=before)
    extra |= {} if answer is None else {ANSWER_FILE: to_json_bytes(answer.to_json())}
    if not options.no_scene:
        extra |= _scene(options, session, read, results)
    if not is_stream(options.out):
        _print_facts(options, str(options.out), archive.pack(folder, options.out, extra))
        return OK
    with temporary_folder() as temporary:
        file = temporary / "session.zip"
        archive.pack(folder, file, extra)
        with file.open("rb") as content:
            write_out(options, options.out, iter(lambda: content.read(1 << 20), b""))
    return OK


def unpack(options: argparse.Namespace) -> int:
    """Write an archive's files as a folder, whose `data` is the session folder."""
    _print_facts(options, str(options.out / "data"), archive.unpack(options.file, options.out))
    return OK


def verify(options: argparse.Namespace) -> int:
    """Check an archive as a whole, and say what it holds."""
    if options.server is None:
        facts = verify_archive(options.file)
    else:
        with connected(options) as api:
            facts = ArchiveFacts.model_validate(api.archives_verify_archive(_content(options.file)))
    told = (in_language(finding, spoken(options).language) for finding in facts.findings)
    said = "".join(f"\n  {finding.text} {finding.to_do}".rstrip() for finding in told)
    _print_facts(options, input_name(options.file), facts, said, with_seal=True)
    return NOT_ACCEPTED if any(finding.severity == "error" for finding in facts.findings) else OK


def replay(options: argparse.Namespace) -> int:
    """Solve an archive afresh and compare; returns 1 where a number differs."""
    found = _replayed_here(options) if options.server is None else _replayed_there(options)
    text = "\n".join(line for stage in found.stages for line in _stage_lines(stage, found))
    print_result(options, text, found.model_dump(mode="json"))
    return OK if found.equal else NOT_ACCEPTED


def _replayed_here(options: argparse.Namespace) -> Replay:
    with archive.opened(options.file) as folder:
        session, read = load_session(folder)
        with progress_bar(options) as progress:
            return replay_session(session, read, stored_results(folder), progress, input_name(options.file))


def _replayed_there(options: argparse.Namespace) -> Replay:
    """Have a server solve the archive, which then does not keep it."""
    with connected(options) as api:
        session = api.archives_import_archive(_content(options.file))["id"]
        try:
            job = api.solves_list_all(session=session, limit=1)["items"][0]["id"]  # an import begins it
            api.wait(job)
            return Replay.model_validate(api.history_get_answer(job)["replay"])
        finally:
            api.sessions_delete(session)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError("an archive, a .zip file", "no such file", "Check the path.", str(path)) from None


def _report(
    options: argparse.Namespace, folder: Path, session: Session, read: ReadFile, results: ResultsData, date: str
) -> dict[str, Content]:
    from calib_core.graph.keys import Graph
    from server.render.report.folder import circumstances_in
    from server.render.report.report import report_html

    stale = Graph.stale_of(session, read, results)
    for stage in stale:
        remark(
            options,
            message(
                "Warning: the result of {stage} is older than its captures: `scancell run` solves it again.",
                stage=stage,
            ),
        )
    try:
        about = circumstances_in(folder, session, read, results, date)
        return {REPORT_FILE: report_html(session, results, stale, truth_of(folder), about).encode()}
    except CalibrationError as error:
        remark(options, message("Warning: packed without the report: {error}", error=error.message))
        return {}


def _scene(
    options: argparse.Namespace, session: Session, read: ReadFile, results: ResultsData
) -> dict[str, Content]:
    from server.measuring import measure
    from server.scenes.offline import scene_html
    from server.scenes.stored import scene_input

    try:
        measured = [measure(session, capture, read) for capture in session.captures]
        return {SCENE_FILE: scene_html(scene_input(session, read, measured, results)).encode()}
    except CalibrationError as error:
        remark(options, message("Warning: packed without the scene: {error}", error=error.message))
        return {}


def _print_facts(
    options: argparse.Namespace, where: str, facts: ArchiveFacts, said: str = "", with_seal: bool = False
) -> None:
    lines = [message("{what}: {why}", what=where, why=_facts(facts))]
    if with_seal:
        lines = [message("{where}: {seal} {facts}", where=where, seal=_seal(facts), facts=_facts(facts))]
    lines += [f"  {stage} ← {hashed}" for stage, hashed in facts.inputs_sha256.items()]
    print_result(options, "\n".join(lines) + said, {"path": where, **facts.model_dump(mode="json")})


def _seal(facts: ArchiveFacts) -> str:
    if facts.sealed is False:
        return message("agrees with its own checksums; NOT what was signed.")
    if facts.sealed:
        return message("agrees with its own checksums; signed by {who}.", who=facts.signed_by)
    return message("agrees with its own checksums; not signed by a key that is trusted here.")


def _facts(facts: ArchiveFacts) -> str:
    verdicts = [f"{stage} {verdict}" for stage, verdict in facts.results.items()] or [message("no results")]
    return message(
        "{session}, {captures}, {verdicts:,}; {files}, {size_mb:.1f} MB",
        session=facts.session or message("session"),
        captures=captures(facts.captures),
        verdicts=verdicts,
        files=files(facts.files),
        size_mb=facts.payload_bytes / 1e6,
    )


def _stage_lines(stage: StageReplay, found: Replay) -> list[str]:
    values = {"stage": stage.stage, "numbers": stage.numbers, "tolerance": found.tolerance}
    if stage.equal and not stage.largest_relative:
        return [message("{stage}: equal ({numbers} numbers, bit for bit; tolerance {tolerance:g})", **values)]
    if stage.equal:
        return [
            message(
                "{stage}: equal ({numbers} numbers, largest difference {largest:.1e}; tolerance {tolerance:g})",
                **values,
                largest=stage.largest_relative,
            )
        ]
    head = message("{stage}: DIFFERS", stage=stage.stage)
    if stage.difference_count:
        head = message(
            "{stage}: DIFFERS in {count} values (tolerance {tolerance:g}, relative)",
            **values,
            count=stage.difference_count,
        )
    rows = [
        "  "
        + message("{path}: {stored} stored, {fresh} now", path=d.path, stored=str(d.stored), fresh=str(d.fresh))
        for d in stage.differences[:_LISTED]
    ]
    more = stage.difference_count - len(rows)
    beyond = ["  " + message("and {more} more (--json lists them)", more=more)] if more > 0 else []
    return [head, *rows, *beyond, *stage.why]
