"""Updates of a data folder: which version its database is of, the copy kept before an update, and the way back."""

import re
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Final, Literal, NamedTuple

from calib_core.disk import remove_file, replace_file
from calib_core.errors import InputError
from calib_core.messages import message
from server.store.engine import address_for_reading

DATABASE: Final = "scancell.db"
_KEPT_FOLDER: Final = "before-updates"
_MOST_KEPT: Final = 5
_REVISION = re.compile(r'^revision(?:: str)? = "(\w+)"', re.MULTILINE)
_KEPT = re.compile(r"scancell-(\w+)-(\d{8}T\d{12})\.db")

State = Literal["none", "older", "current", "newer"]


class WentBack(NamedTuple):
    """The revisions from and to which a database was taken back, and the copy of what it was."""

    before: str
    now: str
    copy: Path


@cache
def known_revisions() -> list[str]:
    """Return the revisions of the tables that this version knows, the present one last; alembic is not needed."""
    files = (Path(__file__).parent / "migrations" / "versions").glob("*.py")
    return sorted(match[1] for file in files if (match := _REVISION.search(file.read_text(encoding="utf-8"))))


def revision_of(database: Path) -> str | None:
    """Return the revision that a database file has, None where there is none; nothing is written."""
    if not database.is_file():
        return None
    try:
        with closing(sqlite3.connect(address_for_reading(database.resolve()), uri=True)) as connection:
            row = connection.execute("SELECT version_num FROM alembic_version").fetchone()
    except sqlite3.Error:
        return None
    return None if row is None else str(row[0])


def state_of(data: Path) -> State:
    """Return whether an older, this or a newer version has written a data folder's database."""
    revision = revision_of(data / DATABASE)
    if revision is None:
        return "none"
    if revision not in known_revisions():
        return "newer"
    return "current" if revision == known_revisions()[-1] else "older"


def keep_before_update(data: Path) -> Path | None:
    """Keep a copy of a database that is about to get another form; return it, None where nothing changes.

    Raises
    ------
    InputError
        If it cannot be written: without it the database is left as it is.
    """
    return _kept_copy(data) if state_of(data) == "older" else None


def updated_since(data: Path) -> datetime | None:
    """Return when a data folder was last given its present form, None where an older one is not known."""
    now = revision_of(data / DATABASE) or ""
    moments = [m[2] for path in _kept(data) if (m := _KEPT.fullmatch(path.name)) and m[1] < now]
    return datetime.strptime(moments[-1], "%Y%m%dT%H%M%S%f").replace(tzinfo=UTC) if moments else None


def go_back(data: Path) -> WentBack:
    """Give a database the form that it had before the last update; all sessions and captures stay.

    What only the newer form can hold stays in the copy that is kept of it.

    Raises
    ------
    InputError
        If it was never updated here, or a newer version than this one has written it.
    ConflictError
        If a server uses the folder.
    """
    from server.settings import Settings
    from server.store.engine import engine_of
    from server.store.folder import folder_lock
    from server.store.schema import downgrade

    with folder_lock(data):
        before = revision_of(data / DATABASE)
        earlier = [name for name in _kept_revisions(data) if before is not None and name < before]
        if before is None or not earlier:
            to_do = message("Start the version of scancell that you want to use: it says whether it can.")
            raise InputError("a data folder that an update changed", "none", to_do, str(data))
        if before not in known_revisions():
            to_do = message("Go back with the version that wrote it, then install the earlier one.")
            raise InputError("a database of this version or an earlier one", before, to_do, str(data))
        copy = _kept_copy(data)
        engine = engine_of(Settings(data=data).sql_url)
        try:
            with engine.execution_options(writing=True).begin() as connection:
                downgrade(connection, max(earlier))
        finally:
            engine.dispose()
        return WentBack(before, max(earlier), copy)


def _kept_revisions(data: Path) -> list[str]:
    return [match[1] for path in _kept(data) if (match := _KEPT.fullmatch(path.name))]


def _kept(data: Path) -> list[Path]:
    """Return the copies that are kept, the oldest first."""
    return sorted((data / _KEPT_FOLDER).glob("scancell-*.db"), key=lambda path: path.stem.rpartition("-")[2])


def _kept_copy(data: Path) -> Path:
    moment = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
    target = data / _KEPT_FOLDER / f"scancell-{revision_of(data / DATABASE)}-{moment}.db"
    fresh = target.with_suffix(".new")
    try:
        target.parent.mkdir(exist_ok=True)
        source = address_for_reading((data / DATABASE).resolve())
        with closing(sqlite3.connect(source, uri=True)) as old, closing(sqlite3.connect(fresh)) as new:
            old.backup(new)
        replace_file(fresh, target)
        for path in _kept(data)[:-_MOST_KEPT]:
            remove_file(path)
    except (OSError, sqlite3.Error) as error:
        to_do = message("Make room there; the database is as it was.")
        need = "room for a copy of the database before its update"
        raise InputError(need, str(error), to_do, str(data)) from None
    return target
