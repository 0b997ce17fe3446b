"""`scancell run`, `check` and `export`: on a session folder or an archive, without a server."""

import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from calib_core.archive.archive import is_archive, opened
from calib_core.archive.folder import (
    folder_of,
    load_results,
    load_session,
    result_data,
    write_atomically,
    write_result,
)
from calib_core.archive.stored_clouds import MEDIA_TYPES
from calib_core.archive.stored_results import stored_results
from calib_core.errors import CalibrationError, InputError
from calib_core.exports.export import export as export_results
from calib_core.exports.registry import export_named
from calib_core.formats.point_writers import write_pieces
from calib_core.records import (
    CameraResult,
    ChainResult,
    LaserPlaneResult,
    MergeResult,
    Record,
    Result,
    Session,
    TcpResult,
    TurntableResult,
)
from calib_core.review.check import check_session
from calib_core.stages.graph import inputs_sha256
from calib_core.stages.pipeline import run as run_stages
from calib_core.stages.stage import ReadFile
from server.commands.progress import progress_bar
from server.render.text.merge_summary import merge_summary
from server.render.text.optics_summary import camera_summary, laser_plane_summary
from server.render.text.summary import tcp_summary
from server.render.text.table_summary import table_summary


def run(path: Path, stage: str, out: Path | None, as_json: bool) -> int:
    """Solve a session, store its results, print them; return 0 where all are accepted, else 1."""
    target = None if out is None and is_archive(path) else out or folder_of(path)

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        if target is not None:
            write_pieces(target / name, pieces)

    with opened(path) as folder:
        session, read = load_session(folder)
        with progress_bar() as progress:
            results = run_stages(session, read, stage, progress, store)
    if as_json:
        data = {"session": session.to_json(), "results": {name: result_data(r) for name, r in results.items()}}
        print(json.dumps(data, ensure_ascii=False, allow_nan=False))
    else:
        print("\n\n".join(_summary(session, result) for result in results.values()))
        if not results:
            print("Nothing to solve: cell.known gives every result.")
    if target is not None:
        _store(results, target, asked=out is not None)
    else:
        print(f"scancell: {path} stays as it is: --out DIR writes the results to a folder.", file=sys.stderr)
    return 1 if any(result.verdict == "fail" for result in results.values()) else 0


def _summary(session: Session, result: Result) -> str:
    match result:
        case CameraResult():
            return camera_summary(result)
        case LaserPlaneResult():
            return laser_plane_summary(result)
        case TcpResult():
            return tcp_summary(session, result)
        case TurntableResult() | ChainResult():
            return table_summary(session, result)
        case MergeResult():
            return merge_summary(result)
        case _:
            return f"{result.verdict.upper()}: {result.method}"


def check(path: Path) -> int:
    """Print what is wrong with a session and what is missing; return 2 where something blocks solving."""
    with opened(path) as folder:
        session, read = load_session(folder)
        findings = check_session(session, read)
    for finding in findings:
        print(f"{finding.level:8} {finding.where}: {finding.sentence}")
    errors = sum(finding.level == "error" for finding in findings)
    if errors:
        print(
            f"scancell: error: {path}: {errors} finding(s) block solving; mend what is said there.",
            file=sys.stderr,
        )
        return 2
    print("Nothing blocks solving.")
    return 0


def export(path: Path, name: str, out: Path | None = None) -> int:
    """Write tool and table, or the merged cloud, in a format; what is not stored or stale is solved first."""
    if name in MEDIA_TYPES:
        from server.commands.clouds import export_cloud

        return export_cloud(path, name, out)
    with opened(path) as folder:
        session, read = load_session(folder)
        results: dict[str, Record | Mapping[str, Any]] = {**load_results(folder)}
        export_named(name, tuple(MEDIA_TYPES))
        if _is_stale(session, read, results.get("tcp")):
            with progress_bar() as progress:
                results |= run_stages(session, read, "tcp", progress)
    content, _ = export_results(session, results, name)
    if out is None:
        sys.stdout.buffer.write(content)
        sys.stdout.flush()
    else:
        write_atomically(out, content)
        print(out)
    return 0


def report(path: Path, out: Path) -> int:
    """Write a session's report as one HTML page; a session without results is solved for it."""
    from server.render.report.report import report_html
    from server.render.report.stale import stale_stages

    if out.suffix.lower() == ".pdf":
        raise InputError(
            "a name for an HTML page", "one for a PDF", "Write HTML; a browser prints it as PDF.", str(out)
        )
    with opened(path) as folder:
        session, read = load_session(folder)
        results = stored_results(folder) or solved_if_possible(session, read)
        stale = stale_stages(session, read, results)
    write_atomically(out, report_html(session, results, stale).encode())
    print(out)
    return 0


def solved_if_possible(session: Session, read: ReadFile) -> dict[str, dict[str, Any]]:
    """Return a session's results as JSON data, stored nowhere; where it cannot be solved yet, say so and go on."""
    try:
        with progress_bar() as progress:
            return {
                stage: result_data(result) for stage, result in run_stages(session, read, "all", progress).items()
            }
    except CalibrationError as error:
        print(f"scancell: warning: nothing is solved: {error}", file=sys.stderr)
        return {}


def _is_stale(session: Session, read: ReadFile, stored: Any) -> bool:
    """Return whether there is no result of the session's captures as they are now."""
    return not isinstance(stored, dict) or stored.get("inputs_sha256") != inputs_sha256(session, "tcp", read)


def _store(results: Mapping[str, Result], folder: Path, asked: bool) -> None:
    """Write the results; where only the session's own folder is read-only, say so and keep the answer."""
    try:
        for stage, result in results.items():
            write_result(folder, stage, result)
    except InputError as error:
        if asked:
            raise
        print(f"scancell: warning: the results are not stored: {error} (or use --out DIR)", file=sys.stderr)
