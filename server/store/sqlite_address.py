"""How SQLite is told of a database file that it only reads."""

from pathlib import PurePath


def address_for_reading(file: PurePath) -> str:
    """Return a file's address for SQLite, which takes none with a machine in it: a share has two slashes."""
    address = file.as_uri()
    if not address.startswith("file:///"):
        address = f"file://{address.removeprefix('file:')}"
    return f"{address}?mode=ro"
