"""`scancell report`: a session as one HTML page that needs nothing else, or as PDF."""

import argparse
from pathlib import Path

from server.console.command import OK, Command, session_argument
from server.console.output import write_out


def _arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="the file to write, .html or .pdf (printed by an installed browser); - is standard output",
    )
    parser.add_argument("--paper", choices=("A4", "letter"), default="A4", help="its paper (A4)")


def _run(options: argparse.Namespace) -> int:
    """Write the report; a session without results is solved for it."""
    from calib_core.archive.archive import is_archive, opened
    from calib_core.archive.dates import solved_when
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results, truth_of
    from calib_core.graph.keys import Graph
    from calib_core.moment import now
    from server.console.language import spoken
    from server.console.solving import solved_if_possible
    from server.render.report.folder import circumstances_in
    from server.render.report.report import report_html

    with opened(options.session) as folder:
        session, read = load_session(folder)
        results = stored_results(folder)
        solved = solved_when(folder, results, unpacked=is_archive(options.session)) if results else now()
        results = results or solved_if_possible(options, session, read)
        stale = Graph.stale_of(session, read, results)
        about = circumstances_in(
            folder, session, read, results, solved, language=spoken(options), paper=options.paper
        )
        page = report_html(session, results, stale, truth_of(folder), about)
    if options.out.suffix.lower() == ".pdf":
        from server.render.pdf import pdf_of

        write_out(options, options.out, [pdf_of(page, str(options.out))])
    else:
        write_out(options, options.out, [page.encode()])
    return OK


COMMAND = Command(
    "report",
    "write a session's report: one HTML page that needs nothing else, or PDF",
    "session",
    _arguments,
    _run,
)
