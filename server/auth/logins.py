"""Who a token or a cookie belongs to; looked up in the database, and remembered for a few seconds."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from hmac import compare_digest
from pathlib import Path
from typing import Literal

from sqlalchemy.orm import Session as Transaction

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.records.acting import THIS_MACHINE
from server.auth.roles import ROLES, Role, to_role
from server.http.errors import LoginError
from server.settings import Settings
from server.store.database import Store
from server.store.models import Data, TokenRow
from server.store.secrets import digest_of, load_key, new_cookie, new_token, token_id_of
from server.store.tokens import (
    add_login,
    add_token,
    good_token,
    has_admin,
    remove_login,
    token_data,
    token_of_login,
)

REMEMBERED_S = 5.0
"""How long a lookup is believed: what another process revokes ends after this time at the latest."""

_MOST_REMEMBERED = 10_000
_LONGEST_NAME = 200
_LONGEST_SECRET = 200


@dataclass(frozen=True)
class Identity:
    """Who sends a request: a token's holder, somebody on this machine, or nobody known."""

    name: str
    role: Role
    by: Literal["token", "cookie", "machine", "nothing"]
    token_id: str | None = None


MACHINE = Identity(THIS_MACHINE, Role.ADMIN, "machine")
NOBODY = Identity("nobody", Role.NOBODY, "nothing")


class Logins:
    """Tokens and logins of one data folder.

    Parameters
    ----------
    data : Path
        The folder that the key of the hashes lies in.
    store : Store
    clock : callable
        Seconds that only grow; for what is remembered.
    """

    def __init__(self, data: Path, store: Store, clock: Callable[[], float] = time.monotonic) -> None:
        self._data = data
        self._store = store
        self._clock = clock
        self._remembered: dict[str, tuple[float, Identity]] = {}
        self._key: bytes | None = None

    def by_token(self, token: str) -> Identity | None:
        """Return who a token was given to, None where it is no good token."""
        return self._found(token, self._look_up_token)

    def by_cookie(self, cookie: str) -> Identity | None:
        """Return who logged in with a cookie, None where the login is over."""
        return self._found(cookie, self._look_up_cookie)

    def make_token(self, db: Transaction, name: str, role: str, lifetime: timedelta | None) -> tuple[Data, str]:
        """Return a new token's record, and the token itself, which is not kept.

        Raises
        ------
        InputError
        """
        name = name.strip()
        if not name or len(name) > _LONGEST_NAME or not name.isprintable():
            need = message("a name of 1 to {longest_name} printable characters", longest_name=_LONGEST_NAME)
            raise InputError(need, repr(name)[:80], "Say who or what the token is for.", "name")
        if role not in ROLES:
            raise InputError.unknown(role, ROLES, "role")
        token_id, token = new_token()
        return token_data(add_token(db, token_id, self._digest(token), name, role, lifetime)), token

    def log_in(self, db: Transaction, token: str, lifetime: timedelta) -> tuple[Identity, str]:
        """Return whose token it is and the value of a new login's cookie.

        Raises
        ------
        LoginError
            If it is no good token.
        """
        row = self._row(db, token)
        if row is None:
            to_do = "Check that all of it was pasted, or ask an admin of this server for a new one."
            raise LoginError("a good token", "one that is unknown, expired or revoked", to_do)
        cookie = new_cookie()
        add_login(db, self._digest(cookie), row, lifetime)
        return _identity(row, "cookie"), cookie

    def log_out(self, db: Transaction, cookie: str) -> None:
        """End a login, if it is one."""
        remove_login(db, self._digest(cookie))

    def forget(self) -> None:
        """Look everybody up afresh: a token or a login has ended, and the transaction is through."""
        self._remembered.clear()

    def remembered(self, secret: str) -> Identity | None:
        """Return whose token or cookie it was found to be a moment ago, without a look into the database."""
        known = self._remembered.get(self._digest(secret))
        return known[1] if known is not None and known[0] >= self._clock() else None

    def _found(self, secret: str, look_up: Callable[[Transaction, str], Identity | None]) -> Identity | None:
        if len(secret) > _LONGEST_SECRET:
            return None
        until_s = self._clock() + REMEMBERED_S
        with self._store.read() as db:
            found = look_up(db, secret)
        if found is not None:  # of wrong secrets there are too many to remember
            if len(self._remembered) >= _MOST_REMEMBERED:
                self._remembered.clear()
            self._remembered[self._digest(secret)] = (until_s, found)
        return found

    def _look_up_token(self, db: Transaction, token: str) -> Identity | None:
        row = self._row(db, token)
        return None if row is None else _identity(row, "token")

    def _look_up_cookie(self, db: Transaction, cookie: str) -> Identity | None:
        row = token_of_login(db, self._digest(cookie))
        return None if row is None else _identity(row, "cookie")

    def _row(self, db: Transaction, token: str) -> TokenRow | None:
        token_id = token_id_of(token)
        row = None if token_id is None else good_token(db, token_id)
        return row if row is not None and compare_digest(row.digest, self._digest(token)) else None

    def _digest(self, secret: str) -> str:
        if self._key is None:
            self._key = load_key(self._data)
        return digest_of(self._key, secret)


def require_admin(settings: Settings) -> None:
    """Refuse to serve where a login is needed and nobody could manage it; raises InputError."""
    store = Store(settings, lambda _: None)
    try:
        store.migrate()
        with store.read() as db:
            found = has_admin(db)
    finally:
        store.close()
    if not found:
        raise InputError(
            "a token of an admin, since a login is demanded here",
            "none",
            "Make one: scancell token create --role admin --name NAME --data {data}. "
            "On 127.0.0.1, the default, no login is needed.",
            settings.host,
            data=settings.data,
        )


def _identity(row: TokenRow, by: Literal["token", "cookie"]) -> Identity:
    return Identity(row.name, to_role(row.role), by, row.id)
