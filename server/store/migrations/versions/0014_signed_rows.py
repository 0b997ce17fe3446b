"""Sessions, captures and equipment are signed as they stand; policies and acknowledgements go into a log."""

from collections.abc import Iterator, Mapping
from secrets import token_hex
from typing import Any

import sqlalchemy as sa
from alembic import op

from server.store.row_seals import row_seal

revision = "0014"
down_revision = "0013"


_JSON = sa.JSON(none_as_null=True)
_SIGNED = {
    "sessions": (("id",), ("id", "created", "record")),
    "captures": (("session_id", "id"), ("session_id", "id", "record", "measured")),
    "equipment": (("id",), ("id", "created", "record")),
}
_LOG = sa.table(
    "signed_log", sa.column("number"), sa.column("kind"), sa.column("of"), sa.column("told", _JSON),
    sa.column("before"), sa.column("seal", _JSON),
)  # fmt: skip
_POLICIES = sa.table("policies", sa.column("cell"), sa.column("record", _JSON))
_ACKNOWLEDGED = sa.table(
    "acknowledged", sa.column("number"), sa.column("cell"), sa.column("fault"), sa.column("of", _JSON),
    sa.column("who"), sa.column("why"), sa.column("created"),
)  # fmt: skip
_RESULTS = sa.table(
    "results", sa.column("number"), sa.column("session_id"), sa.column("stage"), sa.column("record", _JSON)
)
_RELEASES = sa.table("releases", sa.column("number"), sa.column("cell"), sa.column("created"))


def upgrade() -> None:
    for table, (keys, signed) in _SIGNED.items():
        op.add_column(table, sa.Column("seal", _JSON, nullable=True))
        _sign(table, keys, signed)
    op.create_table(
        "signed_log",
        sa.Column("number", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("kind", sa.String(length=16), nullable=False),
        sa.Column("of", sa.String(length=64), nullable=False),
        sa.Column("told", _JSON, nullable=False),
        sa.Column("before", sa.Text(), nullable=False),
        sa.Column("seal", _JSON, nullable=True),
        sa.PrimaryKeyConstraint("number"),
    )
    op.create_index("signed_log_by_subject", "signed_log", ["kind", "of", "number"], unique=False)
    before = ""
    for number, (kind, of, told) in enumerate(_known(), 1):
        row = {"number": number, "kind": kind, "of": of, "told": told, "before": before}
        seal = row_seal("signed_log", row)
        op.get_bind().execute(sa.insert(_LOG).values(**row, seal=seal))
        before = str((seal or {}).get("signature"))
    op.drop_index("acknowledged_by_cell", table_name="acknowledged")
    op.drop_table("acknowledged")
    op.drop_table("policies")


def downgrade() -> None:
    op.create_table(
        "policies",
        sa.Column("cell", sa.String(length=64), nullable=False),
        sa.Column("record", _JSON, nullable=False),
        sa.PrimaryKeyConstraint("cell"),
    )
    op.create_table(
        "acknowledged",
        sa.Column("number", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("cell", sa.String(length=64), nullable=False),
        sa.Column("fault", sa.String(length=32), nullable=False),
        sa.Column("of", sa.JSON(), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("why", sa.Text(), nullable=False),
        sa.Column("created", sa.String(length=32), nullable=False),
        sa.PrimaryKeyConstraint("number"),
    )
    op.create_index("acknowledged_by_cell", "acknowledged", ["cell", "number"], unique=False)
    db, policies = op.get_bind(), {}
    for row in db.execute(sa.select(_LOG).order_by(_LOG.c.number)).mappings().all():
        if row["kind"] == "policy":
            policies[row["of"]] = row["told"]
        elif row["kind"] == "acknowledged":
            db.execute(sa.insert(_ACKNOWLEDGED).values(cell=row["of"], **row["told"]))
    for cell, record in policies.items():
        db.execute(sa.insert(_POLICIES).values(cell=cell, record=record))
    op.drop_index("signed_log_by_subject", table_name="signed_log")
    op.drop_table("signed_log")
    for table in _SIGNED:
        op.drop_column(table, "seal")


def _known() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Give what the log would hold, had there been one: its beginning, and what must not be taken out."""
    db = op.get_bind()
    yield "begun", "", {"id": token_hex(8), "why": "updated"}
    for row in db.execute(sa.select(_RESULTS).order_by(_RESULTS.c.number)).mappings():
        told = {"stage": row["stage"], **{n: row["record"].get(n) for n in ("solved", "decision")}}
        yield "result", row["session_id"], {name: value for name, value in told.items() if value is not None}
    for row in db.execute(sa.select(_RELEASES).order_by(_RELEASES.c.number)).mappings():
        yield "release", row["cell"], {"created": row["created"]}
    for row in db.execute(sa.select(_POLICIES).order_by(_POLICIES.c.cell)).mappings():
        yield "policy", row["cell"], row["record"]
    for row in db.execute(sa.select(_ACKNOWLEDGED).order_by(_ACKNOWLEDGED.c.number)).mappings():
        yield "acknowledged", row["cell"], {n: row[n] for n in ("fault", "of", "who", "why", "created")}


def _sign(table: str, keys: tuple[str, ...], signed: tuple[str, ...]) -> None:
    """Sign rows one after the other: records are long."""
    names = dict.fromkeys((*keys, *signed, "created"))
    typed = (sa.column(name, _JSON) if name in ("record", "measured") else sa.column(name) for name in names)
    rows, db = sa.table(table, *typed, sa.column("seal", _JSON)), op.get_bind()
    for key in db.execute(sa.select(*(rows.c[name] for name in keys))).all():
        this = sa.and_(*(rows.c[name] == value for name, value in zip(keys, key, strict=True)))
        row: Mapping[Any, Any] = db.execute(sa.select(rows).where(this)).mappings().one()
        seal = row_seal(table, {name: row[name] for name in signed}, row["created"])
        db.execute(sa.update(rows).where(this).values(seal=seal))
