"""Files as programs of Windows write them, and folders as its drives are."""

import codecs
import json
import os
import shutil
import sqlite3
import stat
from contextlib import closing
from datetime import datetime
from pathlib import Path, PureWindowsPath
from typing import Never

import numpy as np
import pytest

from calib_core import disk, moment
from calib_core.archive.folder import load_session, parse_json
from calib_core.archive.observation_store import KeptObservations
from calib_core.errors import InputError
from calib_core.formats.points import parse_profile
from server import cli
from server.console.output import is_stream, with_matches
from server.store.engine import address_for_reading, engine_of
from server.store.secrets import load_key


@pytest.fixture
def cell(solved_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(solved_folder, tmp_path / "cell"))


def test_a_record_with_windows_line_ends_and_a_byte_order_mark_is_read(cell: Path) -> None:
    file = cell / "session.json"
    before = load_session(cell)[0]
    file.write_bytes(codecs.BOM_UTF8 + file.read_bytes().replace(b"\n", b"\r\n"))
    assert load_session(cell)[0] == before


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_a_record_that_powershell_wrote_is_read(cell: Path, encoding: str) -> None:
    file = cell / "session.json"
    before = load_session(cell)[0]
    text = file.read_text(encoding="utf-8").replace("\n", "\r\n")
    file.write_bytes((text if encoding == "utf-16" else "\ufeff" + text).encode(encoding))
    assert load_session(cell)[0] == before


def test_a_record_in_a_code_page_is_refused_in_words() -> None:
    with pytest.raises(InputError, match="UTF-8"):
        parse_json('{"name": "Zelle ü"}'.encode("cp1252"), "session.json")


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("change", [lambda b: b.replace(b"\n", b"\r\n"), lambda b: codecs.BOM_UTF8 + b])
def test_scans_with_windows_line_ends_or_a_mark_are_the_same(cell: Path, change) -> None:  # type: ignore[no-untyped-def]
    file = next((cell / "captures").glob("*.csv"))
    content = file.read_bytes().replace(b"\r\n", b"\n")
    np.testing.assert_array_equal(parse_profile(change(content), file.name), parse_profile(content, file.name))


def test_what_is_marked_as_read_only_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows removes no such file; Linux asks its folder, so that Windows' refusal is made here."""
    folder = tmp_path / "folder"
    folder.mkdir()
    file = folder / "file"
    file.touch()
    file.chmod(stat.S_IREAD)
    unlink = os.unlink

    def refusing(name: str, *rest: object, **more: object) -> None:
        if not os.stat(name, **more).st_mode & stat.S_IWRITE:  # type: ignore[arg-type]  # noqa: PTH116 (with what it is asked with)
            raise PermissionError(13, "Access is denied", name)
        unlink(name, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "unlink", refusing)
    monkeypatch.setattr(os, "access", lambda name, _: bool(Path(name).stat().st_mode & stat.S_IWRITE))
    monkeypatch.chdir(folder)
    disk.remove_folder(folder)
    assert not folder.exists()


def test_a_key_is_made_on_a_drive_without_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def link(*_: object) -> None:
        raise OSError(1, "Incorrect function")

    monkeypatch.setattr(os, "link", link)
    key = load_key(tmp_path)
    assert load_key(tmp_path) == key
    assert [path.name for path in tmp_path.iterdir()] == ["login.key"]


@pytest.mark.parametrize(("kind", "journal"), [("cifs", "truncate"), ("nfs4", "truncate"), ("ext4", "wal")])
def test_a_database_on_a_network_drive_shares_no_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, journal: str
) -> None:
    data = tmp_path / "a share"
    data.mkdir()
    mounts = tmp_path / "mounts"
    place = str(data).replace(" ", "\\040")
    mounts.write_text(f"/dev/root / ext4 rw 0 0\n//server/x {place} {kind} rw 0 0\nproc /proc proc rw 0 0\n")
    monkeypatch.setattr(disk, "_MOUNTS", mounts)
    engine = engine_of(f"sqlite:///{data / 'scancell.db'}")
    with engine.begin() as connection:
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == journal
        connection.exec_driver_sql("CREATE TABLE t (a)")
    engine.dispose()
    KeptObservations(data).put("a", b"1")
    with closing(sqlite3.connect(data / "observations.sqlite")) as kept:  # only the quick one is noted in the file
        assert (kept.execute("PRAGMA journal_mode").fetchone() == ("wal",)) == (journal == "wal")
    assert not disk.is_remote(tmp_path)
    shares = ("\\\\server\\x\\", "\\\\?\\UNC\\server\\x\\", "\\\\?\\C:\\", "C:\\")
    assert [disk._SHARE.match(anchor) is not None for anchor in shares] == [True, True, False, False]


def test_a_database_on_a_share_is_read_by_its_path(tmp_path: Path) -> None:
    """SQLite refuses an address with a machine in it: no copy was kept there before an update, no backup made."""
    share = PureWindowsPath("\\\\server\\cells of ü\\scancell.db")
    assert address_for_reading(share) == "file:////server/cells%20of%20%C3%BC/scancell.db?mode=ro"
    assert address_for_reading(PureWindowsPath("D:\\4\\scancell.db")) == "file:///D:/4/scancell.db?mode=ro"
    file = tmp_path / "scancell.db"
    sqlite3.connect(file).close()
    with pytest.raises(sqlite3.OperationalError, match="invalid uri authority"):
        sqlite3.connect(f"file://server{file}?mode=ro", uri=True)
    with closing(sqlite3.connect(f"file:///{file}?mode=ro", uri=True)) as connection:  # two slashes, as of a share
        assert connection.execute("PRAGMA user_version").fetchone() == (0,)
    store = Path(cli.__file__).parent / "store"
    assert [path.name for path in store.rglob("*.py") if ".as_uri()" in path.read_text("utf-8")] == []


def test_a_time_before_1970_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file without a time has one of 1601 there."""

    class Clock(datetime):
        @classmethod
        def fromtimestamp(cls, *_: object) -> Never:  # type: ignore[override]
            raise OSError(22, "Invalid argument")

    monkeypatch.setattr(moment, "datetime", Clock)
    assert moment.text_of_seconds(-11_644_473_600.0) == "1601-01-01T00:00:00.000Z"
    assert moment.text_of_seconds(1_700_000_000.0004) == "2023-11-14T22:13:20.000Z"


def test_stars_stand_for_files_where_no_shell_does_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("b.csv", "a.csv", "c.txt"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    assert with_matches(["poses", "*.csv", "--brand=*", "?.none"]) == [
        "poses",
        "a.csv",
        "b.csv",
        "--brand=*",
        "?.none",
    ]
    monkeypatch.setattr(cli, "WINDOWS", True)
    assert cli.main(["check", "?.txt"]) == 2
    assert "c.txt" in capsys.readouterr().err


def test_nul_is_written_into_and_not_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    from server.console import output

    assert not is_stream(Path("nul"))
    monkeypatch.setattr(output, "WINDOWS", True)
    assert is_stream(Path("nul"))
    assert is_stream(Path("NUL"))


def test_a_session_in_a_read_only_folder_is_solved_and_told(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def mkstemp(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    (cell / "results" / "tcp.json").unlink()
    monkeypatch.setattr("tempfile.mkstemp", mkstemp)
    assert cli.main(["run", str(cell), "--json"]) in (0, 1)
    out, err = capsys.readouterr()
    assert json.loads(out)["results"]["tcp"]["verdict"]
    assert "not stored" in err
