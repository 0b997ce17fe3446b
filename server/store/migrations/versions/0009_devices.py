"""Live devices of cells."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"


def upgrade() -> None:
    op.create_table(
        "devices",
        sa.Column("cell", sa.String(length=64), nullable=False),
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("source", sa.String(length=64), nullable=False),
        sa.Column("settings", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("session_id", sa.String(length=32), nullable=True),
        sa.PrimaryKeyConstraint("cell", "name"),
    )


def downgrade() -> None:
    op.drop_table("devices")
