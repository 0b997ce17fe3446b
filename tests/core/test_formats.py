"""Sessions of an earlier format: read from a folder and from an archive, solved alike."""

import io
import json
from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.archive import opened, pack, verify
from calib_core.archive.folder import load_session, save_session
from calib_core.archive.session_versions import to_present_format
from calib_core.errors import InputError
from calib_core.records import FORMAT
from calib_core.simulation import simulate


def in_format_0(record: dict[str, Any]) -> dict[str, Any]:
    """Return a record as the earlier format wrote it."""
    cell = dict(record["cell"])
    beside = {
        name: cell.pop(name) for name in ("pose_convention", "sphere_diameter_mm", "scanner") if name in cell
    }
    captures = []
    for capture in record["captures"]:
        earlier = {name: value for name, value in capture.items() if name not in ("files", "table_deg")}
        earlier["file"] = capture["files"][0]
        if "table_deg" in capture:
            earlier["table_angle_deg"] = capture["table_deg"]
        captures.append(earlier)
    return {**record, **beside, "format": "scancell-session/0", "cell": cell, "captures": captures}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    simulated = simulate("tcp", 2)
    save_session(tmp_path / "cell", simulated.session, simulated.files)
    return tmp_path / "cell"


def test_a_folder_and_an_archive_of_the_earlier_format_are_the_same_session(folder: Path, tmp_path: Path) -> None:
    session, _ = load_session(folder)
    file = folder / "session.json"
    present = json.loads(file.read_text())
    present["captures"][0]["table_deg"] = 45.0
    file.write_text(json.dumps(present))
    session, _ = load_session(folder)
    file.write_text(json.dumps(in_format_0(present)))
    earlier, read = load_session(folder)
    assert earlier == session
    assert earlier.format == FORMAT
    assert read(earlier.captures[0].files[0])
    pack(folder, tmp_path / "cell.zip")
    archive = (tmp_path / "cell.zip").read_bytes()
    assert b"scancell-session/0" in (folder / "session.json").read_bytes()  # packed byte for byte, as it is
    assert verify(io.BytesIO(archive), "archive").captures == len(session.captures)
    with opened(tmp_path / "cell.zip") as unpacked:
        assert load_session(unpacked)[0] == session


@pytest.mark.parametrize("named", ["scancell-session/2", "", None, 7, "scancell-session/00"])
def test_an_unknown_format_is_named_with_those_that_are_known(named: object) -> None:
    with pytest.raises(InputError, match="scancell-session/0, scancell-session/1") as error:
        to_present_format({"format": named}, "session.json")
    assert "version of scancell" in str(error.value)


def test_a_record_without_format_is_told_what_to_add() -> None:
    with pytest.raises(InputError, match='Add "format": "scancell-session/1"'):
        to_present_format({"cell": {}}, "session.json")


@pytest.mark.parametrize("captures", [None, 3, ["p01"], [{"id": "p01"}]])
def test_what_makes_no_sense_is_left_to_the_record_to_refuse(captures: object) -> None:
    present = to_present_format({"format": "scancell-session/0", "cell": 5, "captures": captures}, "session.json")
    assert (present["format"], present["captures"], present["cell"]) == (FORMAT, captures, {})
