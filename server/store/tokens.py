"""Tokens and logins in the database; what is secret in them comes and goes as a keyed hash."""

from collections.abc import Sequence
from datetime import timedelta

from sqlalchemy import delete, or_, select
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError
from calib_core.messages import message
from calib_core.moment import from_now, now
from server.store.models import Data, LoginRow, TokenRow, required


def add_token(
    db: Transaction, token_id: str, digest: str, name: str, role: str, lifetime: timedelta | None
) -> TokenRow:
    """Store a new token, for good or for a time."""
    expires = None if lifetime is None else from_now(lifetime)
    row = TokenRow(id=token_id, name=name, role=role, digest=digest, created=now(), expires=expires, revoked=None)
    db.add(row)
    return row


def list_tokens(db: Transaction) -> Sequence[TokenRow]:
    """Return all tokens, also those that are no longer good, the newest first."""
    return db.scalars(select(TokenRow).order_by(TokenRow.created.desc(), TokenRow.id)).all()


def good_token(db: Transaction, token_id: str) -> TokenRow | None:
    """Return a token that is still good, None where there is none."""
    row = db.get(TokenRow, token_id)
    return row if row is not None and is_good(row) else None


def is_good(row: TokenRow) -> bool:
    """Return whether a token is neither revoked nor expired."""
    return row.revoked is None and (row.expires is None or row.expires > now())


def has_admin(db: Transaction) -> bool:
    """Return whether somebody can log in as an admin."""
    query = select(TokenRow.id).where(
        TokenRow.role == "admin",
        TokenRow.revoked.is_(None),
        or_(TokenRow.expires.is_(None), TokenRow.expires > now()),
    )
    return db.scalars(query.limit(1)).first() is not None


def token_row(db: Transaction, token_id: str) -> TokenRow:
    """Return a token; raises NotFoundError."""
    got, to_do = (
        message("'{token_id}', which none has", token_id=token_id),
        message("Take one of those that are listed."),
    )
    return required(db.get(TokenRow, token_id), message("a token's id"), got, to_do, "token")


def revoke_token(db: Transaction, token_id: str, but_not: str | None = None) -> None:
    """End a token and all logins that were made with it; revoking it again changes nothing.

    Parameters
    ----------
    db : Transaction
    token_id : str
    but_not : str, optional
        The token that asks for this, which must not end itself.

    Raises
    ------
    NotFoundError, ConflictError
    """
    row = token_row(db, token_id)
    if token_id == but_not:
        need = "another token than the one in use"
        to_do = "Revoke it with another admin's token, or by `scancell token revoke` on the server."
        raise ConflictError(need, "the token that this request was made with", to_do, "token")
    row.revoked = row.revoked or now()
    db.execute(delete(LoginRow).where(LoginRow.token_id == token_id))


def token_data(row: TokenRow) -> Data:
    """Return a token as REST and the command line show it: all but itself."""
    return row.fields("id", "name", "role", "created", "expires", "revoked")


def add_login(db: Transaction, digest: str, token: TokenRow, lifetime: timedelta) -> None:
    """Store a login, which ends with its token at the latest; forget those that are over."""
    db.execute(delete(LoginRow).where(LoginRow.expires <= now()))
    expires = min(from_now(lifetime), token.expires or "9")
    db.add(LoginRow(digest=digest, token_id=token.id, created=now(), expires=expires))


def token_of_login(db: Transaction, digest: str) -> TokenRow | None:
    """Return the token behind a login that is not over, None where there is none."""
    login = db.get(LoginRow, digest)
    if login is None or login.expires <= now():
        return None
    return good_token(db, login.token_id)


def remove_login(db: Transaction, digest: str) -> None:
    """End a login."""
    db.execute(delete(LoginRow).where(LoginRow.digest == digest))
