"""What released versions have stored opens: session folders, archives, and data folders with their database.

`tests/releases` has them as that version wrote them, of a TCP session with thinned profiles: 0.1.0 is `ae2ee4b`.
"""

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calib_core.archive.archive import opened, verify
from calib_core.archive.folder import load_session
from calib_core.archive.stored_results import result_record, stored_results
from calib_core.library.archives import replay
from tests.server.live_server import wait_for

RELEASES = Path(__file__).resolve().parents[1] / "releases"
SIGMAS = 1.0
"""How far a newer solver's answer may lie from the stored one: it is of the same captures."""


@pytest.fixture
def release() -> Path:
    return RELEASES / "0.1.0"


def stored_result(release: Path) -> dict[str, Any]:
    with zipfile.ZipFile(release / "archive.zip") as archive:
        (name,) = [name for name in archive.namelist() if name.endswith("results/tcp.json")]
        return json.loads(archive.read(name))


def require_near(tool: Any, stored: dict[str, Any]) -> None:
    turned_rad, moved_mm = np.split(np.sqrt(np.diag(stored["covariance"])), 2)
    off = np.array(tool) - np.array(stored["tool0_from_laser"])
    assert np.abs(off[:3, 3]).max() < SIGMAS * moved_mm.max()
    assert np.abs(off[:3, :3]).max() < SIGMAS * turned_rad.max()


def test_an_archive_is_whole_and_its_session_is_read(release: Path) -> None:
    assert verify(release / "archive.zip").captures == 14
    with opened(release / "archive.zip") as folder:
        session, read = load_session(folder)
        for capture in session.captures:
            assert read(capture.files[0]).count(b"\n") > 50
        kept = result_record("tcp").model_validate(stored_results(folder)["tcp"]).to_json()
    assert kept["tool0_from_laser"] == stored_result(release)["tool0_from_laser"]


def test_a_replay_says_that_the_method_has_changed_and_by_how_many_sigmas(release: Path) -> None:
    (stage,) = replay(release / "archive.zip").stages
    assert not stage.equal
    (why,) = stage.why
    assert "the method has changed since, which is no damage" in why
    (sigmas,) = re.findall(r"up to ([\d.]+) standard deviations", why)
    assert float(sigmas) < SIGMAS


def test_an_archive_is_imported_with_its_result(release: Path, client: httpx.Client) -> None:
    content = (release / "archive.zip").read_bytes()
    made = client.post("/archives", content=content, headers={"Content-Type": "application/zip"})
    assert made.status_code == 201, made.text
    require_all_there(client, made.json()["id"], release)


def test_a_data_folder_is_served_and_solved_again(
    release: Path, start: Callable[..., Any], tmp_path: Path
) -> None:
    with zipfile.ZipFile(release / "data.zip") as data:
        data.extractall(tmp_path / "data")
    with start() as client:
        (session,) = [item["id"] for item in client.get("/sessions").json()["items"]]
        require_all_there(client, session, release)
        job = wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
        assert job["status"] == "done", job
        answer = client.get(f"/sessions/{session}/answer").json()
        assert (answer["verdict"], answer["stale"], answer["faults"]) == ("pass", False, [])
        require_near(answer["tool0_from_laser"]["matrix"], stored_result(release))
        assert client.get(f"/sessions/{session}/exports/json").status_code == 200


def require_all_there(client: httpx.Client, session: str, release: Path) -> None:
    """Every capture with its files, and the result with its numbers, as they were stored."""
    captures = client.get(f"/sessions/{session}/captures").json()["items"]
    with zipfile.ZipFile(release / "archive.zip") as archive:
        names = archive.namelist()
        for capture in captures:
            (name,) = capture["files"]
            (entry,) = [entry for entry in names if entry.endswith(f"data/{name}")]
            file = client.get(f"/sessions/{session}/captures/{capture['id']}/files/{name}")
            assert file.content == archive.read(entry)
    assert len(captures) == 14
    stored = stored_result(release)
    result = client.get(f"/sessions/{session}/results/tcp").json()
    for field in ("tool0_from_laser", "covariance", "surface_rms_mm", "verdict", "inputs_sha256"):
        assert result[field] == stored[field], field
    assert client.get(f"/sessions/{session}/report").status_code == 200
    history = client.get(f"/sessions/{session}/results/tcp/history")
    assert history.status_code == 200


STORED = RELEASES / "2026-11"
CELL = "cell-of-2026-11"


@pytest.fixture
def data_of_2026_11(tmp_path: Path) -> None:
    with zipfile.ZipFile(STORED / "data.zip") as data:
        data.extractall(tmp_path / "data")


@pytest.mark.thorough
@pytest.mark.usefixtures("data_of_2026_11")
def test_a_data_folder_of_2026_11_is_served_with_its_cell_s_history(start: Callable[..., Any]) -> None:
    with start() as client:
        sessions = client.get("/sessions", params={"limit": 50}).json()["items"]
        assert len(sessions) == 11
        assert {item["name"]: item["stale"] for item in sessions if item["stale"]} == {"tcp-mixed": ["tcp"]}
        history = client.get(f"/cells/{CELL}/history").json()
        assert [(one["action"], one["why"]) for one in history["releases"]] == [
            ("rollback", "scans are off"),
            ("release", "without the table"),
            ("release", "p03 was bumped"),
            ("release", "set up"),
        ]
        assert len(history["sessions"]) == 11
        by_name = {item["name"]: item["id"] for item in sessions}
        table = by_name["turntable"]
        in_force = client.get(f"/cells/{CELL}/answer").json()
        answer = client.get(f"/sessions/{table}/answer").json()
        # What is in force was written on another processor: the same but for its last digits.
        matrices = (np.array(one["tool0_from_laser"]["matrix"]) for one in (in_force, answer))
        np.testing.assert_allclose(*matrices, rtol=0, atol=1e-12)
        # The stored sessions are of different seeds: a drift, which is a fault of the moment.
        assert (answer["stage"], answer["stale"], answer["faults"]) == ("chain", False, ["drift"])
        assert len(client.get(f"/sessions/{table}/results/chain/history").json()["items"]) == 3
        for name in ("tcp", "turntable-untold", "merge", "verify", "recheck"):
            exported = client.get(f"/sessions/{by_name[name]}/exports/json")
            assert exported.status_code == 200, name
            assert client.get(f"/sessions/{by_name[name]}/report").status_code == 200
        refused = client.get(f"/sessions/{by_name['tcp-mixed']}/exports/json")
        assert (refused.status_code, "stale" in refused.text) == (409, True)
        as_before = {"why": "as before", "allow": "drift"}
        released = client.post(f"/sessions/{by_name['verify']}/release", json=as_before)
        assert released.status_code == 201, released.text
        assert client.get(f"/cells/{CELL}/drift").status_code == 200
