"""Names as they are searched: in one case and one Unicode form."""

import unicodedata

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    op.add_column("sessions", sa.Column("name_folded", sa.Text(), nullable=False, server_default=""))
    sessions = sa.table("sessions", sa.column("id"), sa.column("name"), sa.column("name_folded"))
    connection = op.get_bind()
    named = connection.execute(sa.select(sessions.c.id, sessions.c.name).where(sessions.c.name != "")).all()
    folded = [{"row": row.id, "folded": _folded(row.name)} for row in named]
    if folded:
        change = sessions.update().where(sessions.c.id == sa.bindparam("row"))
        connection.execute(change.values(name_folded=sa.bindparam("folded")), folded)
    op.drop_index("sessions_by_age", table_name="sessions")
    op.create_index("sessions_by_age", "sessions", ["created", "id", "name_folded"], unique=False)


def downgrade() -> None:
    op.drop_index("sessions_by_age", table_name="sessions")
    op.drop_column("sessions", "name_folded")
    op.create_index("sessions_by_age", "sessions", ["created", "id"], unique=False)


def _folded(name: str) -> str:
    # A copy on purpose: what this migration once did must not change with the program.
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())
