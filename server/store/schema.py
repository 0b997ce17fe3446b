"""The tables' form: its revisions, and how a database gets from one to another."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection

from calib_core.errors import InputError
from calib_core.messages import message

if TYPE_CHECKING:
    from alembic.config import Config


def upgrade(connection: Connection, revision: str = "heads") -> None:
    """Bring the tables to a revision, all or nothing with the connection's transaction.

    Raises
    ------
    InputError
        If they have a revision that this version does not know.
    """
    from alembic import command
    from alembic.util import CommandError

    if revision == "heads" and stored_revision(connection) == head_revision():
        return
    config = _config()
    config.attributes["connection"] = connection
    try:
        command.upgrade(config, revision)
    except CommandError as error:  # it does not know the revision that it finds
        to_do = message("Use the version that wrote it, or a later one.")
        raise InputError("a database of this version or an earlier one", str(error), to_do, "store") from None


def downgrade(connection: Connection, revision: str) -> None:
    """Take the tables back to an earlier revision, all or nothing with the connection's transaction."""
    from alembic import command

    config = _config()
    config.attributes["connection"] = connection
    command.downgrade(config, revision)


def stored_revision(connection: Connection) -> str | None:
    """Return the revision that a database's tables have, None where there are none."""
    from alembic.migration import MigrationContext

    return MigrationContext.configure(connection).get_current_revision()


@cache
def head_revision() -> str:
    """Return the revision of this version's tables."""
    from alembic.script import ScriptDirectory

    revision = ScriptDirectory.from_config(_config()).get_current_head()
    assert revision is not None
    return revision


def _config() -> "Config":
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    return config
