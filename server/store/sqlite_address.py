"""How SQLite is told of a database file that it only reads."""

from pathlib import PurePath
from urllib.parse import quote


def address_for_reading(file: PurePath) -> str:
    """Return a file's address for SQLite, which takes none with a machine in it: a share has two slashes."""
    path = quote(file.as_posix(), safe="/:")
    return f"file://{path if path[0] == '/' else f'/{path}'}?mode=ro"
