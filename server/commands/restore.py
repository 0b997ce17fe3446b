"""`scancell restore`: a store again, of a backup."""

import argparse
from dataclasses import asdict
from pathlib import Path

from calib_core.messages import message
from server.console.command import OK, Command, data_argument
from server.console.output import print_result, remark


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("backup", type=Path, metavar="BACKUP", help="the folder that `scancell backup` wrote")
    data_argument(parser)


def _run(options: argparse.Namespace) -> int:
    """Make a store of a backup, where there is none yet."""
    from server.settings import Settings
    from server.store.backup import restore
    from server.store.changed_rows import signed_elsewhere
    from server.store.engine import engine_of

    settings = Settings(data=options.data)
    made = restore(options.backup, settings)
    engine = engine_of(settings.sql_url)
    with engine.connect() as connection:
        for said in signed_elsewhere(connection):
            to_do = "Warning: {trouble}. `scancell trust add` that key, or `scancell doctor --accept`"
            remark(options, message(to_do, trouble=said))
    engine.dispose()
    print_result(options, made.said_of(options.data), {"folder": str(options.data), **asdict(made)})
    return OK


COMMAND = Command("restore", "make a data folder (or a database) of a backup", "workbench", _arguments, _run)
