"""Rows that are not as a server stored them: named, and signed as they stand where that is asked for."""

from collections import Counter
from collections.abc import Iterator

from sqlalchemy import Connection, func, select
from sqlalchemy.orm import Session as Transaction
from sqlalchemy.orm import undefer

from calib_core.archive.seals import without_origin
from calib_core.messages import message, plural, templates
from server.settings import Settings
from server.store.engine import engine_of
from server.store.models import CaptureRow, EquipmentRow, LogRow, ReleaseRow, ResultRow, SessionRow
from server.store.removed_rows import is_release_removed, removed_stages
from server.store.row_seals import Signed
from server.store.sessions import latest_results
from server.store.signed_log import begin, end_to_keep, is_whole, keep_end, note, verify_anew
from server.store.store_lock import store_lock

_CAPTURE_CHANGED, _PIECE_CHANGED, _SOURCE_CHANGED, _OF_KEY = templates((
    "its record, or what was measured in it, was changed by other ways than a server",
    "the piece of equipment {piece} was changed by other ways than a server",
    "what its result {number} of {stage} was solved from was changed",
    "signed with the key {key}, which is not trusted here: {count} of the records",
))  # fmt: skip


def changed_rows(connection: Connection) -> Iterator[tuple[str, str, str]]:
    """Give what was changed or taken out: a sentence, the session and the capture, empty where there is none."""
    with Transaction(connection) as db:
        for said in signed_elsewhere(connection):
            yield said, "", ""
        for row in (row for row in _not_holding(db) if row.unknown_key is None):
            if isinstance(row, SessionRow):
                yield message("its record was changed by other ways than a server"), row.id, ""
            elif isinstance(row, CaptureRow):
                yield message(_CAPTURE_CHANGED), row.session_id, row.id
            elif isinstance(row, EquipmentRow):
                yield message(_PIECE_CHANGED, piece=row.id), "", ""
            elif isinstance(row, LogRow):
                yield message("the entry {number} of the signed log was changed", number=row.number), "", ""
        for session, stage in _removed(db):
            yield message("its newest result of {stage} was taken out, or changed", stage=stage), session, ""
        for row in _of_other_origin(db):
            yield message(_SOURCE_CHANGED, number=row.number, stage=row.stage), row.session_id, ""
        for row in _newest_releases(db):
            if is_release_removed(db, row):
                yield (
                    message("cell {cell}: a newer release, or the session that it is of, is gone", cell=row.cell),
                    "",
                    "",
                )
        if not is_whole(db):
            yield message("entries of the signed log were taken out, or an older copy was put back"), "", ""


def signed_elsewhere(connection: Connection) -> list[str]:
    """Return a sentence for each key that signed records and is not trusted here."""
    with Transaction(connection) as db:
        counts = Counter(key for row in _not_holding(db) if (key := row.unknown_key))
    return [message(_OF_KEY, key=key, count=n) for key, n in counts.items()]


def accept(settings: Settings) -> list[str]:
    """Sign rows as they stand, begin the log anew, and say what was done, a sentence each.

    Raises
    ------
    ConflictError
        If a server uses the store.
    """
    engine = engine_of(settings.sql_url)
    verify_anew()
    with store_lock(settings), Transaction(engine.execution_options(writing=True)) as db:
        rows = list(_not_holding(db))
        for row in rows:
            if isinstance(row, EquipmentRow):
                row.certificate_file = row.certificate_file  # and its hash with it
            elif isinstance(row, SessionRow):
                row.name = row.record.get("name", "")
            row.sign()
        for row in list(_of_other_origin(db)):
            row.solved_from, row.record = None, without_origin(row.record)  # nobody knows
        begin(db, "accepted")
        for session, stage in _removed(db):
            for row in db.scalars(select(ResultRow).where(ResultRow.session_id == session)):
                row.verdict = row.record["verdict"]
            there = latest_results(db, session).get(stage, {})
            note(db, "result", session, {"stage": stage, "solved": there.get("solved") or ""})
        for release in _newest_releases(db):
            if db.get(SessionRow, release.session_id) is None:
                note(db, "removed", release.session_id, {"cell": release.cell})
            note(db, "release", release.cell, {"created": release.created})
        end = end_to_keep(db)
        db.commit()
    engine.dispose()
    if end is not None:
        keep_end(end)
    signed = plural(
        "{count} changed row was signed as it stands",
        "{count} changed rows were signed as they stand",
        by="count",
        count=len(rows),
    )
    return [signed, message("the signed log was begun anew")]


def _removed(db: Transaction) -> list[tuple[str, str]]:
    sessions = db.scalars(select(SessionRow.id).order_by(SessionRow.id)).all()
    return [(session, stage) for session in sessions for stage in sorted(removed_stages(db, session))]


def _of_other_origin(db: Transaction) -> Iterator[ResultRow]:
    results = select(ResultRow).options(undefer(ResultRow.solved_from)).execution_options(yield_per=10)
    yield from (row for row in db.scalars(results) if row.has_other_origin)


def _newest_releases(db: Transaction) -> list[ReleaseRow]:
    newest = select(func.max(ReleaseRow.number)).group_by(ReleaseRow.cell)
    return list(db.scalars(select(ReleaseRow).where(ReleaseRow.number.in_(newest)).order_by(ReleaseRow.cell)))


def _not_holding(db: Transaction) -> Iterator[Signed]:
    for table in (SessionRow, CaptureRow, EquipmentRow, LogRow):
        yield from (row for row in db.scalars(select(table)) if not row.holds or _has_other_certificate(row))


def _has_other_certificate(row: Signed) -> bool:
    return isinstance(row, EquipmentRow) and not row.has_its_certificate
