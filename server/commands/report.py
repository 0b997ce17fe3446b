"""`scancell report`: a session as one HTML page that needs nothing else."""

import argparse
from pathlib import Path

from server.console.command import OK, Command, session_argument
from server.console.output import write_out


def _arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="the HTML file to write; - is standard output"
    )


def _run(options: argparse.Namespace) -> int:
    """Write the report; a session without results is solved for it."""
    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results, truth_of
    from calib_core.errors import InputError
    from calib_core.stages.graph import Graph
    from server.console.solving import solved_if_possible
    from server.render.report.report import report_html

    if options.out.suffix.lower() == ".pdf":
        to_do = "Write HTML; a browser prints it as PDF."
        raise InputError("a name for an HTML page", "one for a PDF", to_do, str(options.out))
    with opened(options.session) as folder:
        session, read = load_session(folder)
        results = stored_results(folder) or solved_if_possible(options, session, read)
        stale = Graph.stale_of(session, read, results)
        page = report_html(session, results, stale, truth_of(folder))
    write_out(options, options.out, [page.encode()])
    return OK


COMMAND = Command(
    "report", "write a session's report: one HTML page that needs nothing else", "session", _arguments, _run
)
