"""The register of equipment: sessions refer to its pieces, and keep what it said when they were stored."""

import re
from collections.abc import Sequence
from pathlib import PurePosixPath
from secrets import token_hex

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from calib_core.captures.certificate import is_overdue
from calib_core.errors import ConflictError, DamagedError, NotFoundError
from calib_core.messages import message
from calib_core.moment import now
from calib_core.records import Session
from calib_core.records.policy import Equipment
from server.store.archived_files import add_archived_files
from server.store.audit import note_change, note_difference
from server.store.blobs import Blobs
from server.store.models import Data, EquipmentRow, required
from server.store.process_data import Output


def list_equipment(db: Transaction) -> list[Data]:
    """Return all pieces, by kind and then the oldest first."""
    rows = db.scalars(select(EquipmentRow).order_by(EquipmentRow.created, EquipmentRow.id)).all()
    return sorted(map(equipment_data, rows), key=lambda one: one["kind"])


def equipment_row(db: Transaction, piece: str) -> EquipmentRow:
    """Return a piece's row; raises NotFoundError."""
    row, to_do = db.get(EquipmentRow, piece), message("Take one of those that are listed.")
    return required(row, message("the id of a piece of equipment"), repr(piece[:80]), to_do, "equipment")


def add_equipment(db: Transaction, record: Data) -> EquipmentRow:
    """Store a new piece."""
    moment = now()
    row = EquipmentRow(id=token_hex(8), record=record, created=moment, updated=moment)
    db.add(row)
    db.flush()
    return row


def change_equipment(db: Transaction, row: EquipmentRow, record: Data) -> None:
    """Replace a piece's record; sessions that refer to it stay as they were stored."""
    note_difference(row.record, record)
    row.record, row.updated = record, now()


def remove_equipment(db: Transaction, row: EquipmentRow) -> None:
    """Remove a piece; sessions keep what it said."""
    note_change({"before": row.record, "after": None})
    db.delete(row)


def equipment_data(row: EquipmentRow) -> Data:
    """Return a piece as REST shows it; `overdue` is whether its certificate was due before today."""
    told = {**row.fields("id", "created", "updated"), "altered": not row.holds}
    return {**row.record, **told, "overdue": is_overdue(Equipment.model_validate(row.record), now())}


def certificate_of(row: EquipmentRow) -> bytes:
    """Return the file of a piece's certificate; raises NotFoundError, DamagedError."""
    if not row.has_its_certificate:
        to_do = message("Upload it again, or put it back from a backup.")
        raise DamagedError("a certificate as it was stored", "something else", to_do, row.id)
    if row.certificate_file is None:
        raise NotFoundError("a piece with the file of its certificate", "one without", "Upload it first.", row.id)
    return row.certificate_file


def with_registered(db: Transaction, session: Session) -> Session:
    """Return a session whose equipment says what the register says of the pieces that it refers to."""
    pieces = session.cell.equipment or []
    if not any(one.register_id for one in pieces):
        return session
    told = [_registered(db, one) for one in pieces]
    return session.model_copy(update={"cell": session.cell.model_copy(update={"equipment": told})})


def keep_certificates(db: Transaction, blobs: Blobs, session_id: str, equipment: Sequence[Equipment]) -> None:
    """Keep the files of registered pieces' certificates with a session, so that its archive has them too."""
    for one in equipment:
        row = db.get(EquipmentRow, one.register_id) if one.register_id else None
        file = one.certificate.file if one.certificate else None
        if row is not None and file and file == _kept_as(row.id, file):
            content = certificate_of(row)
            add_archived_files(db, session_id, {file: Output(blobs.put(content), len(content))})


def _registered(db: Transaction, one: Equipment) -> Equipment:
    if one.register_id is None:
        return one
    row = equipment_row(db, one.register_id)
    if not row.holds:
        to_do = message("Hold it against its certificate; `scancell doctor --accept` signs it as it stands.")
        raise ConflictError("a piece as the register stored it", "one changed in the database", to_do, row.id)
    found = Equipment.model_validate({**one.to_json(), **row.record, "register_id": row.id})
    if found.certificate is None or found.certificate.file is None or row.certificate_sha256 is None:
        return found
    told = found.certificate.model_copy(update={"file": _kept_as(row.id, found.certificate.file)})
    return found.model_copy(update={"certificate": told})


def _kept_as(piece: str, name: str) -> str:
    """Return under which name a session keeps the file of a registered piece's certificate."""
    ending = PurePosixPath(name).suffix
    return f"certificates/{piece}{ending if re.fullmatch(r'[.][A-Za-z0-9]{1,8}', ending) else ''}"
