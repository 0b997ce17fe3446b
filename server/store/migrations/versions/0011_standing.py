"""Cells' policies, faults that were acknowledged, and what the audit log keeps of a change."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    op.create_table(
        "policies",
        sa.Column("cell", sa.String(length=64), nullable=False),
        sa.Column("record", sa.JSON(none_as_null=True), nullable=False),
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
    op.add_column("audit", sa.Column("change", sa.JSON(none_as_null=True), nullable=True))


def downgrade() -> None:
    op.drop_column("audit", "change")
    op.drop_index("acknowledged_by_cell", table_name="acknowledged")
    op.drop_table("acknowledged")
    op.drop_table("policies")
