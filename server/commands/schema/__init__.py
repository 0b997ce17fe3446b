"""`scancell schema`: the JSON Schema of a session or of a result; a client in Python."""

import argparse
import sys

from calib_core.messages import message
from server.console.command import OK, Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    from server.commands.schema.records import SCHEMAS

    parser.add_argument("record", metavar="RECORD", help=message("one of {names}", names=", ".join(SCHEMAS)))


def _run(options: argparse.Namespace) -> int:
    from server.commands.schema.records import schema_text

    sys.stdout.write(schema_text(options.record))
    return OK


COMMAND = Command("schema", "print the JSON Schema of a session or of a result", "files", _arguments, _run)
