"""`scancell token` and `scancell audit`: who may, and who did what, on the server's own machine."""

import getpass
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path

from calib_core.errors import InputError
from server.auth.logins import Logins
from server.settings import Settings
from server.store.audit import Act, acting, newest_audit
from server.store.database import Store
from server.store.models import Data
from server.store.tokens import list_tokens, revoke_token, token_data


def create(name: str, role: str, days: float | None, data: Path) -> int:
    """Make a token and print it, alone, on standard output."""
    if days is not None and not 0 < days <= 36525:
        raise InputError(
            "a time of up to 36525 days", f"{days:g}", "Leave it out for a token without end.", "--days"
        )
    with _store(data, f"token create {role}") as store, store.write() as db:
        lifetime = None if days is None else timedelta(days=days)
        record, token = Logins(data, store).make_token(db, name, role, lifetime)
    print(token)
    until = f"until {record['expires']}" if record["expires"] else "until it is revoked"
    print(f"Keep it: it is not shown again. {record['name']} may {_MAY[role]}, {until}.", file=sys.stderr)
    return 0


_MAY = {
    "read": "look at everything",
    "capture": "look, capture and solve",
    "admin": "do everything, also remove sessions and manage tokens",
}


def show(data: Path) -> int:
    """Print all tokens, without what is secret in them."""
    with _store(data, "token list") as store, store.read() as db:
        rows = [token_data(row) for row in list_tokens(db)]
    for row in rows:
        print(f"{row['id']}  {row['role']:8} {_state(row):34} {row['name']}")
    if not rows:
        print("no tokens", file=sys.stderr)
    return 0


def revoke(token_id: str, data: Path) -> int:
    """End a token; a server that runs follows within seconds."""
    with _store(data, f"token revoke {token_id}") as store, store.write() as db:
        revoke_token(db, token_id)
    return 0


def audit(limit: int, data: Path) -> int:
    """Print who did what, the newest first."""
    if limit < 1:
        raise InputError("a number of rows from 1", str(limit), "Give another.", "--limit")
    with _store(data, "audit") as store, store.read() as db:
        for row in newest_audit(db, limit):
            who = f"{row['who']} ({row['role']})"
            print(f"{row['at']}  {row['outcome']:7}  {who:32} {row['address']:15}  {row['method']} {row['path']}")
    return 0


def _state(row: Data) -> str:
    if row["revoked"]:
        return f"revoked {row['revoked']}"
    return f"until {row['expires']}" if row["expires"] else "good"


@contextmanager
def _store(data: Path, command: str) -> Generator[Store]:
    """Open the store of a data folder, also while a server uses it, for a command, which its log will name."""
    user = "?"
    with suppress(OSError, KeyError):  # a user id without a name
        user = getpass.getuser()
    store = Store(Settings(data=data), lambda _: None)
    before = acting.set(Act(f"{user} on the server", "admin", None, "", "command", f"scancell {command}"))
    try:
        store.migrate()
        yield store
    finally:
        acting.reset(before)
        store.close()
