"""Rows that are signed as they are written: what somebody changes in the database is noticed."""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any, ClassVar, Final

from sqlalchemy import JSON, event, inspect
from sqlalchemy.orm import Mapped, mapped_column

from calib_core.archive.keys import keys
from calib_core.archive.seals import seal_state, sealed

_MOST_KNOWN: Final = 50_000
_known: set[int] = set()
"""Hashes of rows that held: a session that is worked on is asked for again and again."""


class Signed:
    """A row with a seal over some of its columns; writing it again mends no seal that was broken before."""

    __tablename__: ClassVar[str]
    signed: ClassVar[tuple[str, ...]]
    seal: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))

    @property
    def holds(self) -> bool:
        """Whether it is as it was written here."""
        return row_holds(self.__tablename__, _fields(self), self.seal)

    @property
    def unknown_key(self) -> str | None:
        """The key that signed it as it stands, where it is not trusted here."""
        seal = {"sha256": _sha256(_fields(self)), "seal": self.seal}
        is_known = self.seal is None or self.seal.get("row") != self.__tablename__ or seal_state(seal) is not None
        return None if is_known else str((self.seal or {}).get("key"))

    def sign(self) -> None:
        """Sign it as it stands."""
        self.seal = row_seal(self.__tablename__, _fields(self))


def row_seal(table: str, fields: Mapping[str, Any], moment: str | None = None) -> dict[str, Any] | None:
    """Return the seal of a row; None where there is no key to sign with."""
    return sealed({"sha256": _sha256(fields)}, {"row": table}, moment).get("seal")


def text_holds(table: str, fields: Mapping[str, str], seal: str) -> bool:
    """Return the same of a row whose JSON comes as text: of many, it is read only where it is new."""
    mark = hash((*fields.values(), seal, keys().trusted))
    if mark in _known:
        return True
    told = {name: json.loads(text) if text[:1] in "{[" else text for name, text in fields.items()}
    if not row_holds(table, told, json.loads(seal or "null")):
        return False
    _known.add(mark)
    return True


def row_holds(table: str, fields: Mapping[str, Any], seal: Mapping[str, Any] | None) -> bool:
    """Return whether a row is what was signed; taken for granted where the key does not outlast the process."""
    if keys().trouble:
        return True
    if seal is None or seal.get("row") != table:
        return False
    digest = _sha256(fields)
    mark = hash((digest, repr(seal), keys().trusted))
    if mark not in _known:
        if not seal_state({"sha256": digest, "seal": seal}):
            return False
        if len(_known) >= _MOST_KNOWN:
            _known.clear()
        _known.add(mark)
    return True


def _sha256(fields: Mapping[str, Any]) -> str:
    """Return the hash of JSON data that comes back as it was stored; `canonical` takes ten times as long."""
    told = {name: value for name, value in fields.items() if value is not None}  # columns may be added
    text = json.dumps(told, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def _fields(row: Signed) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.signed}


@event.listens_for(Signed, "before_insert", propagate=True)
def _sign(_mapper: object, _connection: object, row: Signed) -> None:
    row.sign()


@event.listens_for(Signed, "before_update", propagate=True)
def _sign_anew(_mapper: object, _connection: object, row: Signed) -> None:
    changes = {name: inspect(row).attrs[name].history for name in row.signed}
    if any(change.has_changes() for change in changes.values()):
        before = {n: change.deleted[0] if change.deleted else getattr(row, n) for n, change in changes.items()}
        if row_holds(row.__tablename__, before, row.seal):
            row.sign()
