"""`scancell retention`: sessions that need not be kept any longer, shown first and removed on request."""

import argparse
from typing import TYPE_CHECKING

from server.console.command import OK, Command, data_argument, server_argument
from server.console.output import print_result

if TYPE_CHECKING:
    from server.store.retention import Old

_MEGABYTE = 1_000_000
_GONE_OR_CHANGED = (404, 412)  # meanwhile: then it stays as it is


def _arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    server_argument(parser)
    parser.add_argument("--days", type=float, metavar="D", help="sessions that nobody has changed for so long")
    quota = "the oldest sessions of each cell, until the files of the others need no more than this"
    parser.add_argument("--quota-mb", type=float, metavar="MB", help=quota)
    parser.add_argument("--cell", metavar="ID", help="of this cell alone")
    parser.add_argument("--remove", action="store_true", help="remove them for good; else they are only listed")


def _run(options: argparse.Namespace) -> int:
    """List what may go, and remove it where that is asked for."""
    from dataclasses import asdict

    from calib_core.counted import sessions
    from calib_core.messages import message
    from server.store.retention import require_limits

    require_limits({"--days": options.days, "--quota-mb": options.quota_mb})
    found, removed = _of_store(options) if options.server is None else _of_server(options)
    lines = [
        f"{one.updated[:10]}  {one.cell:24} {one.size / _MEGABYTE:10.1f} MB  {one.why:5}  {one.id}  {one.name}"
        for one in found
    ]
    size = sum(one.size for one in found) / _MEGABYTE
    values = {"sessions": sessions(len(found)), "size_mb": size}
    if options.remove:
        done = message("{sessions}, {size_mb:.1f} MB: {removed} removed.", **values, removed=removed)
    else:
        done = message("{sessions}, {size_mb:.1f} MB. Nothing is removed: add --remove.", **values)
    text = "\n".join([*lines, done])
    print_result(options, text, {"sessions": [asdict(one) for one in found], "removed": removed})
    return OK


def _of_store(options: argparse.Namespace) -> "tuple[list[Old], int]":
    from server.console.audited_store import audited_store
    from server.store.retention import remove_sessions, sessions_beyond

    quota = None if options.quota_mb is None else round(options.quota_mb * _MEGABYTE)
    with audited_store(options.data, "retention") as store:
        with store.read() as db:
            found = sessions_beyond(db, options.days, options.cell, quota)
        return found, remove_sessions(store, found) if options.remove else 0


def _of_server(options: argparse.Namespace) -> "tuple[list[Old], int]":
    from server.console.client import ProblemError
    from server.console.remote import connected
    from server.store.retention import Old

    removed = 0
    with connected(options) as api:
        told = api.cells_list_old(days=options.days, quota_mb=options.quota_mb, cell=options.cell)
        found = [Old(**one) for one in told["items"]]
        for one in found if options.remove else []:
            try:
                api.sessions_delete(one.id, if_match=f'"{one.revision}"')
                removed += 1
            except ProblemError as error:
                if error.status not in _GONE_OR_CHANGED:
                    raise
    return found, removed


COMMAND = Command(
    "retention",
    "list sessions that are old, or beyond a cell's quota, and remove them",
    "workbench",
    _arguments,
    _run,
    uses_server=True,
)
