"""`scancell export`: the calibrated tool and table, or the merged cloud, for another program."""

import argparse
from pathlib import Path

from server.console.command import Command, late, session_argument


def _arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    formats = "json: tool and table; ply, pcd, xyz, e57: the merged cloud; stl: its mesh"
    parser.add_argument("--format", required=True, metavar="NAME", help=formats)
    parser.add_argument(
        "--out", type=Path, default=Path("-"), metavar="FILE", help="the file to write (default standard output)"
    )


COMMAND = Command(
    "export",
    "write tool and table, or the merged cloud, for another program",
    "session",
    _arguments,
    late("server.commands.export.formats", "export"),
)
