"""Captures that wait to be measured."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    op.create_table(
        "waiting",
        sa.Column("number", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("capture_id", sa.String(length=64), nullable=False),
        sa.ForeignKeyConstraint(
            ["session_id", "capture_id"], ["captures.session_id", "captures.id"], ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("number"),
    )
    op.create_index("waiting_by_capture", "waiting", ["session_id", "capture_id"], unique=False)


def downgrade() -> None:
    op.drop_index("waiting_by_capture", table_name="waiting")
    op.drop_table("waiting")
