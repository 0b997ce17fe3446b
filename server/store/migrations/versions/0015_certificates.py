"""The file of a certificate is signed with its piece of equipment, by its hash."""

from hashlib import sha256
from typing import Any

import sqlalchemy as sa
from alembic import op

from server.store.row_seals import row_holds, row_seal

revision = "0015"
down_revision = "0014"

_JSON = sa.JSON(none_as_null=True)
_NAMES = ("id", "created", "certificate_sha256", "certificate_file")
_EQUIPMENT = sa.table(
    "equipment", *(sa.column(name) for name in _NAMES), sa.column("record", _JSON), sa.column("seal", _JSON)
)


def upgrade() -> None:
    op.add_column("equipment", sa.Column("certificate_sha256", sa.String(length=64), nullable=True))
    for row in _with_file():
        _write(row, sha256(row["certificate_file"]).hexdigest())


def downgrade() -> None:
    for row in _with_file():
        _write(row, None)
    op.drop_column("equipment", "certificate_sha256")


def _with_file() -> list[dict[str, Any]]:
    query = sa.select(_EQUIPMENT).where(_EQUIPMENT.c.certificate_file.is_not(None))
    return [dict(row) for row in op.get_bind().execute(query).mappings()]


def _write(row: dict[str, Any], digest: str | None) -> None:
    """Write a file's hash and sign it with the row; one that somebody changed before does not hold afterwards."""
    signed = {name: row[name] for name in ("id", "created", "record", "certificate_sha256")}
    now = {**signed, "certificate_sha256": digest}
    seal = row_seal("equipment", now) if row_holds("equipment", signed, row["seal"]) else row["seal"]
    written = (
        sa.update(_EQUIPMENT).where(_EQUIPMENT.c.id == row["id"]).values(certificate_sha256=digest, seal=seal)
    )
    op.get_bind().execute(written)
