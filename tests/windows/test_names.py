"""Names that Windows keeps for itself, cannot write, or holds for one."""

import json
from pathlib import Path, PureWindowsPath

import pytest

from calib_core import disk
from calib_core.archive import folder as folders
from calib_core.archive.archive import archive_name, pack, unpack, verify
from calib_core.archive.bag_names import is_device_name
from calib_core.disk import extended
from calib_core.errors import InputError
from calib_core.records import Session, parse_session
from server.http.uploads import named_files

POINTS = b"x_mm,z_mm\n0,200\n1,200\n2,200\n"


def session(*files: str, name: str = "cell") -> Session:
    captures = [
        {"id": f"p{k}", "step": "tcp", "kind": "profile", "files": [file], "pose": [0, 0, 0, 0, 0, 0]}
        for k, file in enumerate(files)
    ]
    record = {"format": "scancell-session/1", "name": name, "cell": {"pose_convention": "fanuc"}}
    return parse_session({**record, "captures": captures}, "test")


def folder_with(place: Path, *files: str) -> Path:
    place.mkdir()
    (place / "session.json").write_text(json.dumps(session(*files).to_json()), encoding="utf-8")
    for file in files:
        (place / file).parent.mkdir(parents=True, exist_ok=True)
        (place / file).write_bytes(POINTS)
    return place


@pytest.mark.parametrize("name", ["con", "NUL.csv", "aux.tar.gz", "Com1", "lpt9.txt", "prn ", "CONOUT$", "com¹"])
def test_names_of_devices_are_known(name: str) -> None:
    assert is_device_name(name)


@pytest.mark.parametrize("name", ["conn", "con1", "com10", "nullify.csv", "a.con", "lpt", "scan", "auxiliary"])
def test_names_like_those_of_devices_are_none(name: str) -> None:
    assert not is_device_name(name)


@pytest.mark.parametrize("name", ["captures/con.csv", "aux/p.csv", "captures/p?.csv", 'captures/"p".csv'])
def test_what_windows_cannot_unpack_is_not_packed(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="every system can store"):
        pack(folder_with(tmp_path / "cell", name), tmp_path / "cell.zip")
    assert not (tmp_path / "cell.zip").exists()


@pytest.mark.parametrize("name", ["captures/a:b.csv", "captures\\p.csv", "captures/p.csv.", "captures /p.csv"])
def test_what_leads_elsewhere_on_windows_is_not_packed(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"every system can store|inside the session folder"):
        pack(folder_with(tmp_path / "cell", name), tmp_path / "cell.zip")


def test_names_that_differ_in_case_alone_are_not_packed(tmp_path: Path) -> None:
    cell = folder_with(tmp_path / "cell", "captures/p1.csv", "captures/P1.csv")
    with pytest.raises(InputError, match="more than case"):
        pack(cell, tmp_path / "cell.zip")


def test_names_that_differ_in_case_alone_are_told_where_they_are_one_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = folder_with(tmp_path / "cell", "captures/p1.csv", "captures/P1.csv")
    assert len(folders.load_session(cell)[0].captures) == 2  # two files here
    (cell / "SESSION.JSON").touch()  # as a folder without case answers
    with pytest.raises(InputError, match=r"p1\.csv' and 'captures/P1\.csv"):
        folders.load_session(cell)


@pytest.mark.parametrize("name", ["con", "Nul", "LPT1"])
def test_the_archive_of_a_session_named_like_a_device_has_a_name_of_its_own(tmp_path: Path, name: str) -> None:
    assert archive_name(session(name=name)) == f"session-{name.lower()}"
    assert archive_name(session(name="Zelle 4")) == "zelle-4"


def test_a_capture_named_like_a_device_has_a_file_that_can_be_written(tmp_path: Path) -> None:
    record = {"id": "aux"}
    assert list(named_files(record, [("scan.csv", b"")])) == ["captures/capture-aux.csv"]
    record = {"id": "aux"}
    assert next(iter(named_files(record, [("a.png", b""), ("b.png", b"")]))) == "captures/capture-aux-0001.png"


@pytest.mark.parametrize("sent", ["C:\\scans\\p1.csv", "..\\..\\p1.csv", "\\\\server\\share\\p1.CSV"])
def test_nothing_of_a_path_of_windows_is_used_but_its_ending(sent: str) -> None:
    record = {"id": "p1"}
    assert list(named_files(record, [(sent, b"")])) == ["captures/p1.csv"]


def test_a_long_path_is_extended_and_a_short_one_stays() -> None:
    short, long = PureWindowsPath("C:\\cells\\4"), PureWindowsPath("C:\\" + "\\".join(["folder"] * 50))
    assert extended(short) == short
    assert str(extended(long)) == f"\\\\?\\{long}"
    assert extended(extended(long)) == extended(long)
    assert str(extended(short, room=300)).startswith("\\\\?\\C:\\")
    share = PureWindowsPath("\\\\server\\share\\" + "\\".join(["folder"] * 50))
    assert str(extended(share)) == "\\\\?\\UNC\\" + str(share)[2:]
    assert extended(Path("a" * 300)) == Path("a" * 300)  # of this system


def test_a_long_path_is_unpacked_read_and_written_here(solved_folder: Path, tmp_path: Path) -> None:
    place = tmp_path.joinpath(*["a long name of a folder in which nobody finds anything again"] * 5)
    pack(solved_folder, place / "cell.zip")
    unpack(place / "cell.zip", place / "unpacked")
    assert folders.load_session(place / "unpacked")[0].captures
    assert verify(place / "cell.zip").captures


def test_a_data_folder_in_which_windows_could_not_name_blobs_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from server.store import folder

    monkeypatch.setattr(folder, "WINDOWS", True)
    place = tmp_path.joinpath(*["long name of a folder"] * 9)
    with pytest.raises(InputError, match="at most 160 characters"), folder.folder_lock(place):
        pass
    with folder.folder_lock(tmp_path / "data"):
        assert disk.LONGEST_PLAIN - len("blobs/ab/") - 64 > folder._LONGEST_ON_WINDOWS
