"""`scancell findings`: what the program notices, by code."""

import argparse

from server.console.command import OK, Command
from server.console.output import print_result


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "code", nargs="?", metavar="CODE", help="the page about one code; all are listed without it"
    )


def _run(options: argparse.Namespace) -> int:
    """Print the page about a code, or the list of all."""
    from calib_core.findings.pages import page_of, page_text
    from calib_core.findings.table import CODES, code_named
    from server.console.language import spoken
    from server.console.texts import severity_said

    language = spoken(options)
    if options.code is not None:
        code = code_named(options.code)
        print_result(options, page_text(code, language), page_of(code, language.language))
        return OK
    lines = [
        f"{severity_said(code.severity, language)} {name:36} {page_of(code, language.language)['text'][0]}"
        for name, code in CODES.items()
    ]
    data = {"findings": [page_of(code, language.language) for code in CODES.values()]}
    print_result(options, "\n".join(lines), data)
    return OK


COMMAND = Command(
    "findings", "list what the program notices, or explain one code", "installation", _arguments, _run
)
