"""What each result was solved from, and what a job answered that leaves no result."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    op.add_column("results", sa.Column("solved_from", sa.JSON(none_as_null=True), nullable=True))
    op.add_column("jobs", sa.Column("answer", sa.JSON(none_as_null=True), nullable=True))
