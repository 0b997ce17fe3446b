"""`scancell backup`: all that a server has stored, as it is at one moment."""

import argparse
from dataclasses import asdict
from pathlib import Path

from server.console.command import OK, Command, data_argument
from server.console.output import print_result
from server.console.progress import progress_bar


def _arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="new, or an earlier backup")


def _run(options: argparse.Namespace) -> int:
    """Write a store; a server may use it meanwhile."""
    from server.settings import Settings
    from server.store.backup import back_up

    with progress_bar(options) as progress:
        made = back_up(Settings(data=options.data), options.out, progress)
    print_result(options, made.said_of(options.out), {"folder": str(options.out), **asdict(made)})
    return OK


COMMAND = Command(
    "backup", "write all that a server has stored; it may run meanwhile", "workbench", _arguments, _run
)
