import json
import os
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from calib_core.archive.folder import (
    load_results,
    load_session,
    result_data,
    save_session,
    to_json_bytes,
    write_result,
)
from calib_core.errors import ConflictError, InputError
from calib_core.formats.shared.writing import write_atomically
from calib_core.records import Record, Session, parse_session
from server.cli import main

RECORD = {
    "format": "scancell-session/1",
    "name": "cell 4",
    "cell": {"pose_convention": "abb", "sphere_diameter_mm": 40.0, "colour": "red"},
    "captures": [
        {
            "id": "p01",
            "step": "tcp",
            "kind": "profile",
            "files": ["captures/p01.csv"],
            "pose": [1, 2, 3, 1, 0, 0, 0],
        }
    ],
}
FILES = {"captures/p01.csv": b"1,2\r\n3,4\r\n"}


@pytest.fixture
def session():
    return parse_session(RECORD)


def contents(folder: Path):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_saved_session_comes_back_with_its_files_byte_for_byte(tmp_path, session):
    save_session(tmp_path / "cell", session, FILES)
    for path in (tmp_path / "cell", tmp_path / "cell" / "session.json"):
        loaded, read = load_session(path)
        assert loaded == session
        assert loaded.to_json() == RECORD  # what the format does not know is kept
        assert read("captures/p01.csv") == FILES["captures/p01.csv"]


@pytest.mark.parametrize("past", ["{", "[]", '{"results": {}}', '{"results": [{"stage": "tcp", "record": []}]}'])
def test_a_damaged_past_is_told_before_anything_is_solved_and_nothing_is_stored(tmp_path, session, past, capsys):
    save_session(tmp_path, session, FILES)
    (tmp_path / "history.json").write_text(past)
    before = contents(tmp_path)
    assert main(["run", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "history.json" in said
    assert "Put back a copy of it." in said
    assert contents(tmp_path) == before


def test_saving_the_same_again_changes_nothing_and_another_is_refused(tmp_path, session):
    save_session(tmp_path, session, FILES)
    before = contents(tmp_path)
    save_session(tmp_path, session, FILES)
    with pytest.raises(ConflictError, match=r"captures/p01\.csv there"):
        save_session(tmp_path, session, {"captures/p01.csv": b"5,6\n", "captures/new.csv": b""})
    assert contents(tmp_path) == before


def test_results_are_written_and_read(tmp_path, session):
    class Figures(Record):
        rms_mm: float

    written = write_result(tmp_path, "tcp", Figures(rms_mm=0.5), session)
    path = tmp_path / "results" / "tcp.json"
    stored = load_results(tmp_path)["tcp"]
    assert stored == written
    assert datetime.fromisoformat(stored["solved"]).utcoffset() == timedelta(0)
    assert (stored["rms_mm"], stored["provenance"]) == (0.5, "solved")
    assert result_data(Figures(rms_mm=float("nan"))) == {"rms_mm": None}
    assert oct(path.stat().st_mode & 0o777) == "0o644"


def test_a_result_that_is_cut_off_is_named(tmp_path):
    write_atomically(tmp_path / "results" / "tcp.json", b'{"rms_mm": 0.')
    with pytest.raises(InputError, match=r"results/tcp\.json"):
        load_results(tmp_path)


@pytest.mark.parametrize("broken", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_whole_and_no_litter(tmp_path, monkeypatch, broken):
    path = tmp_path / "tcp.json"
    write_atomically(path, b"old")

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(*((os, "fsync") if broken == "fsync" else (Path, "replace")), fail)
    with pytest.raises(InputError, match="No space left on device") as caught:
        write_atomically(path, b"new")
    assert caught.value.where == str(path)
    assert contents(tmp_path) == {"tcp.json": b"old"}


def test_nan_is_never_written():
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json_bytes({"a": float("nan")})


def test_an_archive_is_named_as_such(tmp_path):
    path = tmp_path / "cell.zip"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match="an archive"):
        load_session(path)


def test_a_file_beside_the_captures_is_not_read_through_a_link(tmp_path, session):
    save_session(tmp_path / "cell", session, FILES)
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret" / "p01.csv").write_text("1,2\n")
    (tmp_path / "cell" / "captures" / "p01.csv").unlink()
    (tmp_path / "cell" / "captures").rmdir()
    (tmp_path / "cell" / "captures").symlink_to(tmp_path / "secret")
    _, read = load_session(tmp_path / "cell")
    with pytest.raises(InputError, match="leads out of it"):
        read("captures/p01.csv")


def test_a_folder_in_place_of_a_file(tmp_path, session):
    save_session(tmp_path, session, FILES)
    (tmp_path / "captures" / "p01.csv").unlink()
    (tmp_path / "captures" / "p01.csv").mkdir()
    _, read = load_session(tmp_path)
    with pytest.raises(InputError, match="got something else"):
        read("captures/p01.csv")


def test_the_record_is_written_as_plain_json(tmp_path, session):
    save_session(tmp_path, session, FILES)
    assert Session.model_validate(json.loads((tmp_path / "session.json").read_text())) == session
