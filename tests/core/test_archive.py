"""Archives: what goes in comes out, any BagIt tool verifies it, and the commands take it as a session."""

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from calib_core.archive.archive import archive_name, opened, pack, unpack, verify
from calib_core.archive.bag_zip import CHUNK_BYTES
from calib_core.archive.folder import load_session
from calib_core.errors import ConflictError, InputError
from calib_core.records import Session
from server.cli import main
from tests.core.archives import tree


@pytest.fixture
def archive(packed: bytes, tmp_path: Path) -> Path:
    file = tmp_path / "cell.zip"
    file.write_bytes(packed)
    return file


@pytest.mark.thorough
def test_what_was_packed_is_unpacked_byte_for_byte(solved_folder, archive, tmp_path):
    facts = unpack(archive, tmp_path / "out")
    unpacked = tree(tmp_path / "out" / "data")
    assert unpacked.pop("report.html") == b"<p>report</p>"
    assert unpacked == tree(solved_folder)
    assert (facts.captures, facts.results, facts.report, facts.scene) == (14, {"tcp": "warn"}, True, False)
    assert facts.files == len(unpacked) + 1
    assert facts.payload_bytes == sum(map(len, unpacked.values())) + len(b"<p>report</p>")
    assert load_session(tmp_path / "out")[0] == load_session(solved_folder)[0]


def test_the_public_bagit_tool_finds_it_valid_and_an_altered_one_not(archive, tmp_path):
    unpack(archive, tmp_path / "out")
    command = [sys.executable, "-m", "bagit", "--validate", "--quiet", str(tmp_path / "out")]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    with (tmp_path / "out" / "data" / "session.json").open("a") as file:
        file.write(" ")
    assert subprocess.run(command, capture_output=True, check=False).returncode != 0


def test_a_bag_of_the_public_tool_is_read_with_its_own_manifests(solved_folder, tmp_path):
    shutil.copytree(solved_folder, tmp_path / "bag")
    command = [sys.executable, "-m", "bagit", "--quiet", "--sha256", str(tmp_path / "bag")]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    shutil.make_archive(str(tmp_path / "in-a-folder"), "zip", tmp_path, "bag")
    shutil.make_archive(str(tmp_path / "at-the-top"), "zip", tmp_path / "bag")
    for name in ("in-a-folder.zip", "at-the-top.zip"):
        assert verify(tmp_path / name).captures == 14


def test_it_is_one_folder_in_a_zip_that_bears_its_name(archive):
    with zipfile.ZipFile(archive) as file:
        tops = {name.split("/")[0] for name in file.namelist()}
    assert tops == {"simulated-tcp-spoiled-seed-7"}


def test_the_same_session_gives_the_same_bytes(solved_folder, packed, tmp_path):
    again = tmp_path / "elsewhere" / "cell"
    shutil.copytree(solved_folder, again)
    os.utime(again / "session.json", (1, 1))
    pack(again, tmp_path / "other.zip", {"report.html": b"<p>report</p>"})
    assert (tmp_path / "other.zip").read_bytes() == packed


def test_names_of_all_kinds_survive(tmp_path):
    folder = session_folder(tmp_path / "s", ["captures/Größe 50%.csv", "captures/%0A.csv", "captures/測定.csv"])
    pack(folder, tmp_path / "a.zip")
    unpack(tmp_path / "a.zip", tmp_path / "out")
    assert tree(tmp_path / "out" / "data") == tree(folder)


def session_folder(folder: Path, names: list[str]) -> Path:
    (folder / "captures").mkdir(parents=True)
    captures = []
    for number, name in enumerate(names):
        (folder / name).write_bytes(b"1,2\n")
        captures.append({"id": f"p{number}", "step": "scan", "kind": "profile", "files": [name]})
    record = {"format": "scancell-session/1", "cell": {"pose_convention": "ur"}, "captures": captures}
    (folder / "session.json").write_text(json.dumps(record))
    return folder


@pytest.mark.parametrize("size", [CHUNK_BYTES - 1, CHUNK_BYTES, 8 * CHUNK_BYTES + 1])
def test_blank_files_are_no_bomb(tmp_path, size):
    folder = session_folder(tmp_path / "s", ["captures/p.csv"])
    (folder / "captures" / "p.csv").write_bytes(b"," * size)
    pack(folder, tmp_path / "a.zip")
    unpack(tmp_path / "a.zip", tmp_path / "out")
    assert (tmp_path / "out" / "data" / "captures" / "p.csv").stat().st_size == size


def test_hidden_files_and_the_archive_itself_stay_out(tmp_path):
    folder = session_folder(tmp_path / "s", ["captures/p.csv"])
    (folder / ".session.json.x7").write_bytes(b"half a file")
    (folder / ".git").mkdir()
    (folder / ".git" / "config").write_bytes(b"x")
    first = pack(folder, folder / "a.zip")
    assert pack(folder, folder / "a.zip") == first
    with zipfile.ZipFile(folder / "a.zip") as file:
        assert [n for n in file.namelist() if "/data/" in n] == [
            "session/data/captures/p.csv",
            "session/data/session.json",
        ]


def test_links_that_stay_inside_are_packed_as_files_and_others_refused(tmp_path):
    folder = session_folder(tmp_path / "s", ["captures/p.csv"])
    (folder / "captures" / "q.csv").symlink_to(folder / "captures" / "p.csv")
    pack(folder, tmp_path / "a.zip")
    unpack(tmp_path / "a.zip", tmp_path / "out")
    assert not (tmp_path / "out" / "data" / "captures" / "q.csv").is_symlink()
    for target in (tmp_path / "outside.txt", tmp_path):
        (tmp_path / "outside.txt").write_text("secret")
        (folder / "captures" / "out").symlink_to(target)
        with pytest.raises(InputError, match="link"):
            pack(folder, tmp_path / "b.zip")
        (folder / "captures" / "out").unlink()
    assert not (tmp_path / "b.zip").exists()


@pytest.mark.parametrize("spoil", ["missing", "names", "result", "session"])
def test_what_could_not_be_unpacked_is_not_packed(tmp_path, spoil):
    folder = session_folder(tmp_path / "s", ["captures/p.csv"])
    if spoil == "missing":
        (folder / "captures" / "p.csv").unlink()
    elif spoil == "names":
        (folder / "captures" / "P.csv").write_bytes(b"another")
    elif spoil == "result":
        (folder / "results").mkdir()
        (folder / "results" / "tcp.json").write_text('{"stage": "tcp"}')
    else:
        (folder / "session.json").write_text("{")
    with pytest.raises(InputError) as raised:
        pack(folder, tmp_path / "a.zip")
    assert str(folder) in str(raised.value)
    assert [p.name for p in tmp_path.iterdir()] == ["s"]


def test_nothing_that_is_there_is_overwritten(archive, tmp_path):
    (tmp_path / "out").mkdir()
    unpack(archive, tmp_path / "out")  # an empty folder is as good as none
    before = tree(tmp_path / "out")
    with pytest.raises(ConflictError, match="new or empty"):
        unpack(archive, tmp_path / "out")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(ConflictError, match="new or empty"):
        unpack(archive, tmp_path / "link")
    assert tree(tmp_path / "out") == before


def test_a_failure_in_the_middle_leaves_nothing(archive, tmp_path, monkeypatch):
    calls = []
    fsync = os.fsync

    def failing(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 7:
            raise OSError(28, "No space left on device")
        fsync(handle)

    monkeypatch.setattr("os.fsync", failing)
    with pytest.raises(InputError, match="no space left"):
        unpack(archive, tmp_path / "new" / "deep" / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["cell.zip"]


def test_a_failed_pack_keeps_the_older_archive(solved_folder, archive, packed, monkeypatch):
    def full(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match="No space left"):
        pack(solved_folder, archive)
    assert archive.read_bytes() == packed
    assert [p.name for p in archive.parent.iterdir()] == ["cell.zip"]


def test_messages_name_the_archive_not_a_temporary_folder(archive):
    def read_what_is_not_there() -> None:
        with opened(archive) as folder:
            load_session(folder)[1]("captures/none.csv")

    with pytest.raises(InputError) as raised:
        read_what_is_not_there()
    assert str(raised.value).startswith(f"{archive}: captures/none.csv: need a file, got no such file")


@pytest.mark.parametrize(
    ("name", "expected"),
    [("Zelle 4 – früh", "zelle-4-fr-h"), ("", "session"), ("../..", "session"), ("a" * 99, "a" * 60)],
)
def test_an_archive_is_named_plainly(name, expected):
    session = Session.model_validate({"name": name, "cell": {"pose_convention": "ur"}})
    assert archive_name(session) == expected


@pytest.mark.thorough
def test_the_commands(solved_folder, tmp_path, capsys):
    file = tmp_path / "cell.zip"
    assert main(["archive", "pack", str(solved_folder), "--out", str(file), "--no-scene"]) == 0
    assert main(["archive", "verify", str(file)]) == 0
    assert "14 captures, tcp warn" in capsys.readouterr().out
    assert main(["archive", "unpack", str(file), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "data" / "report.html").read_text().startswith("<!doctype html>")
    assert main(["archive", "unpack", str(file), "--out", str(tmp_path / "out")]) == 2
    assert main(["archive", "verify", str(tmp_path / "none.zip")]) == 2
    err = capsys.readouterr().err
    assert "no such file" in err
    assert err.count("\n") == 2


@pytest.mark.thorough
def test_an_archive_is_taken_wherever_a_session_is(solved_folder, archive, tmp_path, capsys):
    assert main(["run", str(archive), "--json"]) == 0
    found, err = capsys.readouterr()
    assert "stays as it is" in err
    assert main(["run", str(solved_folder), "--json", "--out", str(tmp_path / "results")]) == 0
    stored = json.loads(capsys.readouterr().out)
    assert stored["results"]["tcp"].pop("solved")  # what is not stored has no date
    unstored = json.loads(found)
    assert unstored["results"]["tcp"].pop("solved") is None
    assert unstored == stored
    assert main(["run", str(archive), "--out", str(tmp_path / "of-archive")]) == 0
    written = json.loads((tmp_path / "of-archive" / "results" / "tcp.json").read_text())
    told = {name: written[name] for name in ("solved", "provenance", "seal")}
    assert written == {**json.loads(found)["results"]["tcp"], **told}
    assert main(["check", str(archive)]) == 0
    capsys.readouterr()
    assert main(["export", str(archive), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["inputs_sha256"] == written["inputs_sha256"]
    assert main(["report", str(archive), "--out", str(tmp_path / "r.html")]) == 0
    assert (tmp_path / "r.html").read_text().startswith("<!doctype html>")
    assert not list(Path(tmp_path).glob("**/.*"))


@pytest.mark.thorough
def test_an_unsolved_session_is_solved_for_its_archive_and_the_folder_stays(tmp_path, capsys, solved_folder):
    folder = tmp_path / "s"
    shutil.copytree(solved_folder, folder)
    shutil.rmtree(folder / "results")
    before = tree(folder)
    assert main(["archive", "pack", str(folder), "--out", str(tmp_path / "a.zip")]) == 0
    assert tree(folder) == before
    facts = verify(tmp_path / "a.zip")
    assert (facts.results, facts.report, facts.scene) == ({"tcp": "warn"}, True, True)
    capsys.readouterr()
    assert main(["archive", "replay", str(tmp_path / "a.zip")]) == 0
    assert re.match(r"tcp: equal \(\d+ numbers, bit for bit", capsys.readouterr().out)


def test_a_session_that_cannot_be_solved_yet_is_packed_all_the_same(tmp_path, capsys):
    folder = session_folder(tmp_path / "s", ["captures/p.csv"])
    assert main(["archive", "pack", str(folder), "--out", str(tmp_path / "a.zip"), "--no-scene"]) == 0
    assert "nothing is solved" in capsys.readouterr().err
    assert verify(tmp_path / "a.zip").results == {}
    assert main(["archive", "replay", str(tmp_path / "a.zip")]) == 2
    assert "stored results to compare with" in capsys.readouterr().err
