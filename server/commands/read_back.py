"""`scancell read-back`: the tool, or a fixed scanner's user frame, in the controller compared with the answer."""

import argparse
from pathlib import Path

from server.console.command import NOT_ACCEPTED, OK, Command, session_argument
from server.console.output import print_result


def _arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    file = "the controller's file or backup, saved after the tool was entered"
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE", help=file)
    parser.add_argument(
        "--tool", metavar="N", help="the number or name in the file, of the tool or the user frame"
    )
    numbers = "the tool's numbers as the pendant shows them, with blanks or commas between"
    parser.add_argument("--numbers", metavar="NUMBERS", help=numbers)
    convention = "what the numbers mean (default: the session's pose convention)"
    parser.add_argument("--convention", metavar="NAME", help=convention)
    parser.add_argument("--brand", metavar="NAME", help="the controller's brand, where the file does not tell it")


def _run(options: argparse.Namespace) -> int:
    """Compare a tool with the answer; status 1 where they differ, or the answer is stale or failed."""
    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_results, load_session
    from calib_core.errors import InputError
    from calib_core.exports.answer import answer_of
    from calib_core.graph.keys import Graph
    from calib_core.library.machines import files_of
    from calib_core.review.in_controller import compared_with
    from calib_core.review.provenance import replayed

    with opened(options.session) as folder:
        session, read = load_session(folder)
        results = replayed(session, read, load_results(folder))
        answer = answer_of(session, results, Graph.stale_of(session, read, results))
    if (options.numbers is None) == (options.file is None):
        raise InputError("FILE or --numbers", "both or neither", "Name one of these.", "read-back")
    found = compared_with(
        answer,
        numbers=options.numbers,
        convention=options.convention,
        files=None if options.file is None else files_of(options.file),
        brand=options.brand,
        named=options.tool,
    )
    print_result(options, found.words, found.to_json())
    return OK if found.equal and not found.faults else NOT_ACCEPTED


COMMAND = Command(
    "read-back", "compare the tool in the controller with a session's answer", "session", _arguments, _run
)
