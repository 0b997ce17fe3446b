"""`scancell retention`: sessions that need not be kept any longer, shown first and removed on request."""

import argparse

from server.console.command import OK, Command, data_argument
from server.console.output import print_result

_MEGABYTE = 1_000_000


def _arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    parser.add_argument("--days", type=float, metavar="D", help="sessions that nobody has changed for so long")
    quota = "the oldest sessions of each cell, until the files of the others need no more than this"
    parser.add_argument("--quota-mb", type=float, metavar="MB", help=quota)
    parser.add_argument("--cell", metavar="ID", help="of this cell alone")
    parser.add_argument("--remove", action="store_true", help="remove them for good; else they are only listed")


def _run(options: argparse.Namespace) -> int:
    """List what may go, and remove it where that is asked for."""
    import math
    from dataclasses import asdict

    from calib_core.errors import InputError
    from server.console.audited_store import audited_store
    from server.store.retention import remove_sessions, sessions_beyond

    limits = {"--days": options.days, "--quota-mb": options.quota_mb}
    if all(limit is None for limit in limits.values()):
        raise InputError("--days or --quota-mb", "neither", "Say what need not be kept.", "retention")
    for name, limit in limits.items():
        if limit is not None and not (math.isfinite(limit) and 0 <= limit <= 1e9):
            raise InputError("a number from 0 to 1e9", f"{limit:g}", "Give another.", name)
    quota = None if options.quota_mb is None else round(options.quota_mb * _MEGABYTE)
    with audited_store(options.data, "retention") as store:
        with store.read() as db:
            found = sessions_beyond(db, options.days, options.cell, quota)
        removed = remove_sessions(store, found) if options.remove else 0
    lines = [
        f"{one.updated[:10]}  {one.cell:24} {one.size / _MEGABYTE:10.1f} MB  {one.why:5}  {one.id}  {one.name}"
        for one in found
    ]
    size = sum(one.size for one in found) / _MEGABYTE
    done = f"{removed} removed." if options.remove else "Nothing is removed: add --remove."
    text = "\n".join([*lines, f"{len(found)} sessions, {size:.1f} MB. {done}"])
    print_result(options, text, {"sessions": [asdict(one) for one in found], "removed": removed})
    return OK


COMMAND = Command(
    "retention",
    "list sessions that are old, or beyond a cell's quota, and remove them",
    "workbench",
    _arguments,
    _run,
)
