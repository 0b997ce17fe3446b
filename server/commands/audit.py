"""`scancell audit`: who did what on a server."""

import argparse

from server.console.command import OK, Command, data_argument
from server.console.output import print_result


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--limit", type=int, default=100, metavar="N", help="how many rows (%(default)s)")
    data_argument(parser)


def _run(options: argparse.Namespace) -> int:
    """Print who did what, the newest first."""
    from calib_core.errors import InputError
    from server.console.audited_store import audited_store
    from server.store.audit import newest_audit

    if options.limit < 1:
        raise InputError("a number of rows from 1", str(options.limit), "Give another.", "--limit")
    with audited_store(options.data, "audit") as store, store.read() as db:
        rows = [dict(row) for row in newest_audit(db, options.limit)]
    lines = [
        f"{row['at']}  {row['outcome']:7}  {row['who'] + ' (' + row['role'] + ')':32} {row['address']:15}  "
        f"{row['method']} {row['path']}"
        for row in rows
    ]
    if lines or options.json:
        print_result(options, "\n".join(lines), {"rows": rows})
    return OK


COMMAND = Command("audit", "print who did what on a server, the newest first", "workbench", _arguments, _run)
