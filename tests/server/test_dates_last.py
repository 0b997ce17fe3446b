"""Dates last: when it was captured and solved is the same in folder, archives, import, report, restored store."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.cli import main
from server.settings import Settings
from server.store.backup import back_up
from tests.core.archives import entries_of
from tests.server.live_server import serving, wait_for
from tests.verified import verified_session, written

ZIP = {"Content-Type": "application/zip"}
TAKEN = "2025-03-30T01:{minute:02}:00+01:00"


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Live where the day is another one."""
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def dated(folder: Path) -> Path:
    """Return a folder that was captured and solved in another year."""
    made = verified_session(3)
    for number, capture in enumerate(made.session.captures):
        made.session.captures[number] = capture.model_copy(
            update={"taken": TAKEN.format(minute=number), "clock": "device"}
        )
    written(made, folder)
    for path in (folder / "results").glob("*.json"):
        record = json.loads(path.read_text())
        path.write_text(json.dumps({**record, "solved": "2025-04-01T08:15:00.000Z"}))
    return folder


def of_server(client: httpx.Client, session: str) -> dict[str, Any]:
    captures = client.get(f"/sessions/{session}/captures", params={"limit": 200}).json()["items"]
    answer = client.get(f"/sessions/{session}/answer").json()
    results = client.get(f"/sessions/{session}/results").json()
    return {
        "taken": {one["id"]: (one.get("taken"), one.get("clock")) for one in captures},
        "solved": answer["solved"],
        "results": {name: one["solved"] for name, one in results.items()},
    }


def of_archive(content: bytes) -> dict[str, Any]:
    files = {info.filename.partition("/data/")[2]: data for info, data in entries_of(content)}
    results = {
        name.removeprefix("results/").removesuffix(".json"): json.loads(data)
        for name, data in files.items()
        if name.startswith("results/") and name.endswith(".json")
    }
    return {
        "taken": {
            one["id"]: (one.get("taken"), one.get("clock"))
            for one in json.loads(files["session.json"])["captures"]
        },
        "solved": json.loads(files["answer.json"])["solved"],
        "results": {name: one["solved"] for name, one in results.items()},
    }


def imported(client: httpx.Client, content: bytes) -> str:
    session = client.post("/archives", content=content, headers=ZIP).raise_for_status().json()["id"]
    for job in client.get("/jobs", params={"session": session}).json()["items"]:
        wait_for(client, job["id"])
    return session


@pytest.mark.usefixtures("elsewhere")
def test_dates_are_the_same_wherever_a_session_goes(tmp_path: Path) -> None:
    folder = dated(tmp_path / "cell")
    assert main(["archive", "pack", str(folder), "--no-scene", "--out", str(tmp_path / "by-command.zip")]) == 0
    packed = (tmp_path / "by-command.zip").read_bytes()
    told = of_archive(packed)
    assert told["solved"] == "2025-04-01T08:15:00.000Z"
    assert set(told["results"].values()) == {"2025-04-01T08:15:00.000Z"}
    assert all(taken.startswith("2025-03-30T01:") for taken, _ in told["taken"].values())
    assert {clock for _, clock in told["taken"].values()} == {"device"}

    settings = Settings(data=tmp_path / "one", port=0, warm_up=False)
    with serving(settings) as client:
        session = imported(client, packed)
        assert of_server(client, session) == told
        again = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
        assert of_archive(again) == told
        report = client.get(f"/sessions/{session}/report").text
        assert "2025-04-01 08:15 UTC" in report
        assert "2025-03-30 01:00 UTC+01:00" in report
        assert "UTC+01:00 (the device" in report
        back_up(settings, tmp_path / "backup")
    restored = tmp_path / "two"
    assert main(["restore", str(tmp_path / "backup"), "--data", str(restored)]) == 0
    with serving(Settings(data=restored, port=0, warm_up=False)) as client:
        assert of_server(client, session) == told
    with serving(Settings(data=tmp_path / "three", port=0, warm_up=False)) as client:
        assert of_server(client, imported(client, again)) == told
