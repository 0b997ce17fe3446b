"""The tables: records as JSON beside the few columns that are searched."""

import unicodedata
from hashlib import sha256
from typing import Any, TypeVar

from sqlalchemy import JSON, BigInteger, ForeignKey, ForeignKeyConstraint, Index, LargeBinary, String, Text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, validates

from calib_core.archive.seals import IMPORTED, SOLVED, has_origin, is_origin, seal_state, with_provenance
from calib_core.errors import NotFoundError
from server.store.row_seals import Signed

Data = dict[str, Any]


class Base(DeclarativeBase):
    """All tables of the store."""

    type_annotation_map = {Data: JSON(none_as_null=True), str: Text}  # noqa: RUF012

    def fields(self, *names: str) -> Data:
        """Return some of a row's columns by their names."""
        return {name: getattr(self, name) for name in names}


class TokenRow(Base):
    """An API token: who it was given to and what it is good for; of the token itself only a keyed hash."""

    __tablename__ = "tokens"
    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    role: Mapped[str] = mapped_column(String(16))
    digest: Mapped[str] = mapped_column(String(64))
    created: Mapped[str] = mapped_column(String(32))
    expires: Mapped[str | None] = mapped_column(String(32))
    revoked: Mapped[str | None] = mapped_column(String(32))


class LoginRow(Base):
    """A browser that logged in with a token; of its cookie only a keyed hash."""

    __tablename__ = "logins"
    digest: Mapped[str] = mapped_column(String(64), primary_key=True)
    token_id: Mapped[str] = mapped_column(ForeignKey("tokens.id", ondelete="CASCADE"), index=True)
    created: Mapped[str] = mapped_column(String(32))
    expires: Mapped[str] = mapped_column(String(32), index=True)


class AuditRow(Base):
    """Who did what, or was refused it; rows are only ever added, the database itself refuses all else."""

    __tablename__ = "audit"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    created: Mapped[str] = mapped_column(String(32))
    who: Mapped[str] = mapped_column(String(200))
    role: Mapped[str] = mapped_column(String(16))
    token_id: Mapped[str | None] = mapped_column(String(16))
    address: Mapped[str] = mapped_column(String(64))
    method: Mapped[str] = mapped_column(String(16))
    path: Mapped[str] = mapped_column(String(500))
    outcome: Mapped[str] = mapped_column(String(16))
    change: Mapped[Data | None]


def folded(text: str) -> str:
    """Return text as it is searched: letters of one case and one Unicode form."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


Row = TypeVar("Row", bound="Base")


def required(row: Row | None, need: str, got: str, to_do: str, where: str) -> Row:
    """Return a row that was asked for; raises NotFoundError where there is none."""
    if row is None:
        raise NotFoundError(need, got, to_do, where)
    return row


class SessionRow(Signed, Base):
    """A session: its record without captures."""

    __tablename__ = "sessions"
    signed = ("id", "created", "record")
    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    name: Mapped[str]
    created: Mapped[str] = mapped_column(String(32))
    updated: Mapped[str] = mapped_column(String(32))
    revision: Mapped[int] = mapped_column(default=1)
    last_event: Mapped[int] = mapped_column(default=0)
    last_position: Mapped[int] = mapped_column(default=0)
    record: Mapped[Data]
    simulated: Mapped[Data | None]
    name_folded: Mapped[str] = mapped_column(server_default="")

    __table_args__ = (Index("sessions_by_age", "created", "id", "name_folded"),)  # a search reads nothing else

    @validates("name")
    def _fold(self, _: str, name: str) -> str:
        self.name_folded = folded(name)
        return name

    @property
    def holds(self) -> bool:
        """Whether it is as it was written here, under the name that stands in its record."""
        return super().holds and self.name == self.record.get("name", "")

    @property
    def cell_id(self) -> str:
        """The id of the cell that the session is of."""
        from calib_core.review.answer import cell_id_of

        return cell_id_of(self.record["cell"].get("id"), self.record.get("name", ""))


class CaptureRow(Signed, Base):
    """A capture: its record and what was measured in it; `position` is the order of arrival."""

    __tablename__ = "captures"
    signed = ("session_id", "id", "record", "measured")
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    position: Mapped[int]
    revision: Mapped[int] = mapped_column(default=1)
    created: Mapped[str] = mapped_column(String(32))
    record: Mapped[Data]
    measured: Mapped[Data]

    __table_args__ = (Index("captures_in_order", "session_id", "position"),)


class WaitingRow(Base):
    """A capture that came with many others and waits to be measured."""

    __tablename__ = "waiting"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    session_id: Mapped[str] = mapped_column(String(32))
    capture_id: Mapped[str] = mapped_column(String(64))

    __table_args__ = (
        ForeignKeyConstraint(
            ["session_id", "capture_id"], ["captures.session_id", "captures.id"], ondelete="CASCADE"
        ),
        Index("waiting_by_capture", "session_id", "capture_id"),
    )


class FileRow(Base):
    """One file of a capture: the name in its record and the blob with its bytes."""

    __tablename__ = "files"
    session_id: Mapped[str] = mapped_column(String(32), primary_key=True)
    capture_id: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    sha256: Mapped[str] = mapped_column(String(64))
    size: Mapped[int]

    __table_args__ = (
        ForeignKeyConstraint(
            ["session_id", "capture_id"], ["captures.session_id", "captures.id"], ondelete="CASCADE"
        ),
        Index("files_by_content", "sha256"),
        Index("files_by_name", "session_id", "name"),
    )


class ResultRow(Base):
    """One solve's result; earlier ones of the same stage are kept.

    `solved_from` is what it was computed from: `session`, the record as it was then, and `files`, its files'
    SHA-256 by name. It is not known of results that came with an archive.
    """

    __tablename__ = "results"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"))
    stage: Mapped[str] = mapped_column(String(32))
    created: Mapped[str] = mapped_column(String(32))
    verdict: Mapped[str] = mapped_column(String(8))
    record: Mapped[Data]
    solved_from: Mapped[Data | None] = mapped_column(deferred=True)

    def proved(self) -> Data:
        """Return the record with the provenance that its seal proves."""
        return {**with_provenance(self.record), **({"provenance": IMPORTED} if self.has_other_origin else {})}

    def origin(self) -> Data | None:
        """Return what it was solved from; None where that is not known, or not what was signed with it."""
        return None if self.has_other_origin else self.solved_from

    @property
    def has_other_origin(self) -> bool:
        """Whether what it says that it was solved from is not what was signed with it, or was taken off."""
        seal = self.record.get("seal") or {}
        if seal.get("provenance") != SOLVED or "solved_from" not in self.__dict__:
            return False  # or nobody asked for it: the latest are held against the captures themselves
        return has_origin(seal) if self.solved_from is None else not is_origin(self.solved_from, seal)

    __table_args__ = (Index("results_by_stage", "session_id", "stage", "number"),)


class OutputRow(Base):
    """A file that a stage made beside its latest result, such as the merged cloud: its name and its blob."""

    __tablename__ = "outputs"
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    stage: Mapped[str] = mapped_column(String(32))
    sha256: Mapped[str] = mapped_column(String(64))
    size: Mapped[int] = mapped_column(BigInteger)

    __table_args__ = (Index("outputs_by_content", "sha256"),)


class JobRow(Base):
    """A solve on its way or past; `answer` is what one leaves that makes no result."""

    __tablename__ = "jobs"
    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), index=True)
    stage: Mapped[str] = mapped_column(String(32))
    status: Mapped[str] = mapped_column(String(16), index=True)
    progress: Mapped[float] = mapped_column(default=0.0)
    message: Mapped[str] = mapped_column(default="")
    error: Mapped[Data | None]
    created: Mapped[str] = mapped_column(String(32))
    finished: Mapped[str | None] = mapped_column(String(32))
    answer: Mapped[Data | None] = mapped_column(deferred=True)


class EventRow(Base):
    """What happened in a session, numbered from 1 without gaps."""

    __tablename__ = "events"
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(16))
    data: Mapped[Data]
    created: Mapped[str] = mapped_column(String(32))


class ServerNumberRow(Base):
    """The number of the server that may write, one row: see `store_lock.DatabaseLock`."""

    __tablename__ = "server_number"
    number: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)


class AnswerRow(Base):
    """The answer to a POST that carried an Idempotency-Key, to be given again."""

    __tablename__ = "answers"
    scope: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    fingerprint: Mapped[str] = mapped_column(String(64))
    status: Mapped[int]
    body: Mapped[Data]
    created: Mapped[str] = mapped_column(String(32), index=True)


class ReleaseRow(Base):
    """An answer that somebody released for a cell; what is in force is the newest. It outlives its session."""

    __tablename__ = "releases"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    cell: Mapped[str] = mapped_column(String(64))
    session_id: Mapped[str] = mapped_column(String(32))
    action: Mapped[str] = mapped_column(String(16))
    who: Mapped[str]
    why: Mapped[str]
    created: Mapped[str] = mapped_column(String(32))
    answer: Mapped[Data]

    def about(self) -> Data:
        """Return what its seal says beside the answer."""
        return self.fields("cell", "session_id", "action", "who", "why", "created")

    @property
    def holds(self) -> bool:
        """Whether it is as it was stored here, by the seal of its answer, which knows no `stale`."""
        seal, faults = self.answer.get("seal") or {}, self.answer.get("faults") or ()
        told = {**seal, "stale": "stale" in faults}
        about = {**self.about(), "stale": self.answer.get("stale")}
        return bool(seal_state(self.answer)) and about == {name: told.get(name) for name in about}

    __table_args__ = (Index("releases_by_cell", "cell", "number"),)


class LogRow(Signed, Base):
    """An entry of the signed log: `of` is a session or a cell, `before` the signature of the entry before it."""

    __tablename__ = "signed_log"
    signed = ("number", "kind", "of", "told", "before")
    number: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(16))
    of: Mapped[str] = mapped_column(String(64))
    told: Mapped[Data]
    before: Mapped[str]

    __table_args__ = (Index("signed_log_by_subject", "kind", "of", "number"),)


class EquipmentRow(Signed, Base):
    """A piece of equipment in the server's register, with the file of its certificate."""

    __tablename__ = "equipment"
    signed = ("id", "created", "record", "certificate_sha256")
    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    record: Mapped[Data]
    created: Mapped[str] = mapped_column(String(32))
    updated: Mapped[str] = mapped_column(String(32))
    certificate_file: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    certificate_sha256: Mapped[str | None] = mapped_column(String(64))

    @validates("certificate_file")
    def _know(self, _: str, content: bytes | None) -> bytes | None:
        self.certificate_sha256 = None if content is None else sha256(content).hexdigest()
        return content

    @property
    def has_its_certificate(self) -> bool:
        """Whether the file is the one that was stored with it."""
        content = self.certificate_file
        return (None if content is None else sha256(content).hexdigest()) == self.certificate_sha256


class DeviceRow(Base):
    """A live device of a cell, its settings without secrets, and the session that it is connected for."""

    __tablename__ = "devices"
    cell: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    source: Mapped[str] = mapped_column(String(64))
    settings: Mapped[Data]
    session_id: Mapped[str | None] = mapped_column(String(32))
