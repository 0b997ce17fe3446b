"""Results and releases that were stored before there were seals count as solved here: they are signed."""

from collections.abc import Iterator, Mapping
from typing import Any

import sqlalchemy as sa
from alembic import op

from calib_core.archive.seals import sealed, signed_result

revision = "0012"
down_revision = "0011"


_JSON = sa.JSON(none_as_null=True)
_RESULTS = sa.table(
    "results",
    sa.column("number"), sa.column("record", _JSON), sa.column("solved_from", _JSON), sa.column("created"),
)  # fmt: skip
_RELEASES = sa.table(
    "releases", sa.column("number"), sa.column("answer", _JSON), sa.column("cell"), sa.column("session_id"),
    sa.column("action"), sa.column("who"), sa.column("why"), sa.column("created"),
)  # fmt: skip


def upgrade() -> None:
    for row in _rows(_RESULTS):
        if "seal" not in row["record"]:
            _keep(_RESULTS, row, record=_signed_result(row, row["record"]))
    for row in _rows(_RELEASES):
        if "seal" not in row["answer"]:
            _keep(_RELEASES, row, answer=_signed_answer(row, row["answer"]))


def downgrade() -> None:
    """Take off the seals that updating gives; others stay: earlier versions keep fields that they do not know."""
    for row in _rows(_RESULTS):
        plain = _without(row["record"], "seal", "provenance")
        if row["record"] == _signed_result(row, plain):
            _keep(_RESULTS, row, record=plain)
    for row in _rows(_RELEASES):
        plain = _without(row["answer"], "seal")
        if row["answer"] == _signed_answer(row, plain):
            _keep(_RELEASES, row, answer=plain)


def _rows(table: sa.TableClause) -> Iterator[Mapping[Any, Any]]:
    """Read one row after the other: records are long."""
    db, number = op.get_bind(), table.c.number
    for one in db.scalars(sa.select(number)).all():
        yield db.execute(sa.select(table).where(number == one)).mappings().one()


def _keep(table: sa.TableClause, row: Mapping[Any, Any], **values: Any) -> None:
    op.get_bind().execute(sa.update(table).where(table.c.number == row["number"]).values(**values))


def _signed_result(row: Mapping[Any, Any], record: dict[str, Any]) -> dict[str, Any]:
    session: dict[str, Any] = (row["solved_from"] or {}).get("session") or {}
    return signed_result(record, session, moment=row["created"])


def _signed_answer(row: Mapping[Any, Any], answer: dict[str, Any]) -> dict[str, Any]:
    about = {name: row[name] for name in ("cell", "session_id", "action", "who", "why", "created")}
    return sealed(answer, about, row["created"])


def _without(data: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in data.items() if name not in names}
