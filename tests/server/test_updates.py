"""Updates of a data folder: told, a copy kept before, and back again with nothing lost."""

import re
import sqlite3
import zipfile
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from calib_core.errors import ConflictError, InputError
from server.cli import main
from server.settings import Settings
from server.store.folder import folder_lock
from server.store.schema import head_revision
from server.store.store_lock import store_lock
from server.store.updates import go_back, known_revisions, revision_of, state_of, updated_since

RELEASES = Path(__file__).resolve().parents[1] / "releases"


def data_of(release: str, place: Path) -> Path:
    """Return the data folder of a release, unpacked."""
    with zipfile.ZipFile(RELEASES / release / "data.zip") as archive:
        archive.extractall(place)
    (database,) = place.rglob("scancell.db")
    return database.parent


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The data folder of the first release."""
    return data_of("0.1.0", tmp_path)


def blobs_of(data: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (data / "blobs").rglob("*") if path.is_file()}


def rows_of(database: Path, like: Path | None = None) -> dict[str, list[Any]]:
    """Return all rows by table; with another database, of its tables and columns."""
    with closing(sqlite3.connect(database)) as connection:
        columns = columns_of(like or database)
        return {
            table: sorted(connection.execute(f"SELECT {', '.join(names)} FROM {table}").fetchall(), key=repr)
            for table, names in columns.items()
        }


def columns_of(database: Path) -> dict[str, list[str]]:
    with closing(sqlite3.connect(database)) as connection:
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {
            table: sorted(row[1] for row in connection.execute(f"PRAGMA table_info({table})"))
            for table in tables
            if not table.startswith("sqlite_")
        }


def test_the_known_revisions_are_alembics() -> None:
    assert known_revisions()[-1] == head_revision()
    assert len(set(known_revisions())) == len(known_revisions())


@pytest.mark.parametrize("release", sorted(path.parent.name for path in RELEASES.glob("*/data.zip")))
def test_data_of_a_release_is_updated_and_taken_back_and_nothing_is_lost(release: str, tmp_path: Path) -> None:
    data = data_of(release, tmp_path)
    database, blobs = data / "scancell.db", blobs_of(data)
    before, form, revision = rows_of(database), columns_of(database), revision_of(database)
    assert state_of(data) == "older"
    with store_lock(Settings(data=data)):
        pass
    assert state_of(data) == "current"
    assert updated_since(data) is not None
    (kept,) = (data / "before-updates").iterdir()
    assert (rows_of(kept), revision_of(kept)) == (before, revision)
    updated = rows_of(database)
    assert {table: len(rows) for table, rows in updated.items() if table in before} == {
        table: len(rows) for table, rows in before.items()
    }
    went = go_back(data)
    assert (went.before, went.now, revision_of(database)) == (known_revisions()[-1], revision, revision)
    assert columns_of(database) == form
    assert updated_since(data) is None
    assert rows_of(database) == before
    assert rows_of(went.copy) == updated
    with store_lock(Settings(data=data)):
        pass
    again = rows_of(database)
    for table in ("sessions", "captures", "files", "results", "outputs", "audit"):
        assert again[table] == updated[table], table
    assert blobs_of(data) == blobs
    assert len(blobs) > 10


def test_what_came_after_the_update_is_there_after_going_back(data: Path) -> None:
    with store_lock(Settings(data=data)):
        pass
    database = data / "scancell.db"
    with closing(sqlite3.connect(database)) as connection, connection:
        connection.execute("UPDATE sessions SET name = 'after the update'")
    go_back(data)
    with closing(sqlite3.connect(database)) as connection:
        assert connection.execute("SELECT name FROM sessions").fetchall()[0] == ("after the update",)


def test_a_folder_that_needs_no_update_is_left_alone(tmp_path: Path) -> None:
    for _ in range(2):
        with store_lock(Settings(data=tmp_path / "data")):
            pass
    assert not (tmp_path / "data" / "before-updates").exists()
    with pytest.raises(InputError, match="that an update changed"):
        go_back(tmp_path / "data")


def test_nobody_goes_back_under_a_running_server(data: Path) -> None:
    with store_lock(Settings(data=data)), pytest.raises(ConflictError):
        go_back(data)


def test_without_room_for_the_copy_nothing_is_updated(data: Path) -> None:
    (data / "before-updates").write_bytes(b"")  # a file where the folder would be
    with pytest.raises(InputError, match="room for a copy"), store_lock(Settings(data=data)):
        pass
    assert state_of(data) == "older"


def test_the_commands_tell(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SCANCELL_DATA", str(data))
    assert main(["--version"]) == 0
    assert re.match(
        rf"scancell \d.*\n{re.escape(str(data))}: written by an older version", capsys.readouterr().out
    )
    with store_lock(Settings(data=data)):
        pass
    assert main(["update", "--data", str(data)]) == 0
    assert "written by this version" in capsys.readouterr().out
    assert main(["update", "--data", str(data), "--back"]) == 0
    assert "install the earlier version" in capsys.readouterr().out
    with closing(sqlite3.connect(data / "scancell.db")) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    assert main(["update", "--data", str(data)]) == 1
    assert "newer version" in capsys.readouterr().out
    assert main(["update", "--data", str(data), "--back"]) == 2
    with folder_lock(data):
        pass
