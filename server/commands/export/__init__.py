"""`scancell export`: the calibrated tool and table, or the merged cloud, for another program."""

import argparse
from pathlib import Path

from server.console.command import Command, late, session_argument


def _arguments(parser: argparse.ArgumentParser) -> None:
    from calib_core.archive.stored_clouds import media_types
    from calib_core.exports.registry import all_exports
    from calib_core.proof import is_experimental

    session_argument(parser)
    proved = ", ".join(export.name for export in all_exports() if not is_experimental(export.proof))
    others = ", ".join(export.name for export in all_exports() if is_experimental(export.proof))
    formats = f"tool and table: {proved}; the merged cloud or its mesh: {', '.join(media_types())}"
    formats += f"; experimental, proved by no controller and no real file: {others}"
    parser.add_argument("--format", required=True, metavar="NAME", help=formats)
    parser.add_argument("--tool", metavar="N", help="the tool's number or name in the controller")
    parser.add_argument("--frame", metavar="N", help="the user frame's number or name, for the turntable")
    parser.add_argument("--part", choices=("tool", "table", "both"), help="what is written")
    into = (
        "a controller's backup (file, zip or folder): the file with this entry is written, all else byte for byte"
    )
    parser.add_argument("--into", type=Path, metavar="BACKUP", help=into)
    poses = "with which poses it will be used: the controller's own, or those corrected by the arm's errors"
    parser.add_argument("--poses", choices=("controller", "corrected"), help=poses)
    settings = "another setting of the export; may be given several times"
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=settings)
    allow = "export an answer in spite of its faults, by their names (such as stale,verify-fail): it is marked"
    parser.add_argument("--allow", default="", metavar="WHAT", help=allow)
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
