"""`scancell run`: solves a session folder or an archive, without a server."""

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from server.console.command import NOT_ACCEPTED, OK, Command, session_argument
from server.console.output import print_result, remark

if TYPE_CHECKING:
    from calib_core.records import Result


def _arguments(parser: argparse.ArgumentParser) -> None:
    from calib_core.stages.registry import stage_names

    session_argument(parser)
    stages = f"all (default), or one of {', '.join(stage_names())}"
    parser.add_argument("--stage", default="all", metavar="STAGE", help=stages)
    parser.add_argument("--out", type=Path, metavar="DIR", help="write results/ here instead of into the session")


def _run(options: argparse.Namespace) -> int:
    """Solve a session, store its results, print them; return 0 where all are accepted, else 1."""
    from calib_core.archive.archive import is_archive, opened
    from calib_core.archive.folder import folder_of, load_session, result_data
    from calib_core.formats.shared.writing import write_pieces
    from calib_core.stages.pipeline import run
    from server.console.progress import progress_bar

    path: Path = options.session
    target = None if options.out is None and is_archive(path) else options.out or folder_of(path)

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        if target is not None:
            write_pieces(target / name, pieces)

    with opened(path) as folder:
        session, read = load_session(folder)
        with progress_bar(options) as progress:
            results = run(session, read, options.stage, progress, store)
    text = "\n\n".join(str(result) for result in results.values())
    data = {"session": session.to_json(), "results": {name: result_data(r) for name, r in results.items()}}
    print_result(options, text or "Nothing to solve: cell.known gives every result.", data)
    if target is not None:
        _store(options, results, target)
    else:
        remark(options, f"{path} stays as it is: --out DIR writes the results to a folder.")
    return NOT_ACCEPTED if any(result.verdict == "fail" for result in results.values()) else OK


def _store(options: argparse.Namespace, results: Mapping[str, "Result"], folder: Path) -> None:
    """Write the results; where only the session's own folder is read-only, say so and keep the answer."""
    from calib_core.archive.folder import write_result
    from calib_core.errors import InputError

    try:
        for stage, result in results.items():
            write_result(folder, stage, result)
    except InputError as error:
        if options.out is not None:
            raise
        remark(options, f"warning: the results are not stored: {error} (or use --out DIR)")


COMMAND = Command("run", "solve a session folder or archive, no server needed", "session", _arguments, _run)
