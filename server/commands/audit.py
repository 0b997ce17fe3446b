"""`scancell audit`: who did what on a server."""

import argparse
from typing import Any, Final

from calib_core.messages import templates
from server.console.command import OK, Command, data_argument, server_argument
from server.console.output import print_result

_PAGE: Final = 1000  # rows that a server gives at once
_OUTCOMES: Final = templates({"done": "done", "refused": "refused"})


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--limit", type=int, default=100, metavar="N", help="how many rows (%(default)s)")
    data_argument(parser)
    server_argument(parser)


def _run(options: argparse.Namespace) -> int:
    """Print who did what, the newest first."""
    from calib_core.errors import InputError
    from calib_core.evidence.text import padded
    from server.console.language import spoken

    if options.limit < 1:
        raise InputError("a number of rows from 1", str(options.limit), "Name another.", "--limit")
    rows = _of_store(options) if options.server is None else _of_server(options)
    said = spoken(options)
    lines = [
        f"{row['at']}  {padded(said.say(_OUTCOMES[row['outcome']]), 9)}  "
        f"{padded(said.say(row['who']) + ' (' + row['role'] + ')', 32)} {row['address']:15}  "
        f"{row['method']} {row['path']}"
        for row in rows
    ]
    if lines or options.json:
        print_result(options, "\n".join(lines), {"rows": rows})
    return OK


def _of_store(options: argparse.Namespace) -> list[dict[str, Any]]:
    from server.console.audited_store import audited_store
    from server.store.audit import newest_audit

    with audited_store(options.data, "audit") as store, store.read() as db:
        return [dict(row) for row in newest_audit(db, options.limit)]


def _of_server(options: argparse.Namespace) -> list[dict[str, Any]]:
    from server.console.remote import connected

    rows: list[dict[str, Any]] = []
    cursor: str | None = None
    with connected(options) as api:
        while len(rows) < options.limit:
            page = api.access_audit(limit=min(options.limit - len(rows), _PAGE), cursor=cursor)
            rows += page["items"]
            cursor = page["next"]
            if cursor is None:
                break
    return rows


COMMAND = Command(
    "audit", "print who did what on a server, the newest first", "workbench", _arguments, _run, uses_server=True
)
