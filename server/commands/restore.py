"""`scancell restore`: a store again, of a backup."""

import argparse
from dataclasses import asdict
from pathlib import Path

from server.console.command import OK, Command, data_argument
from server.console.output import print_result


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("backup", type=Path, metavar="BACKUP", help="the folder that `scancell backup` wrote")
    data_argument(parser)


def _run(options: argparse.Namespace) -> int:
    """Make a store of a backup, where there is none yet."""
    from server.settings import Settings
    from server.store.backup import restore

    made = restore(options.backup, Settings(data=options.data))
    print_result(options, made.said_of(options.data), {"folder": str(options.data), **asdict(made)})
    return OK


COMMAND = Command("restore", "make a data folder (or a database) of a backup", "workbench", _arguments, _run)
