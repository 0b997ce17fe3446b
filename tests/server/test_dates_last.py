"""Dates last: when it was captured and solved is the same in folder, archives, import, report, restored store."""

import hashlib
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from calib_core.moment import now
from server.cli import main
from server.settings import Settings
from server.store.backup import back_up
from tests.core.archives import entries_of
from tests.server.live_server import serving, simulated_session, wait_for
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


CERTIFICATE = b"%PDF-1.7 K-123"


@pytest.mark.usefixtures("elsewhere")
def test_an_auditor_finds_dates_release_and_certificate_in_the_archive_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    began = now()
    with serving(Settings(data=tmp_path / "one", port=0, warm_up=False)) as client:
        session = simulated_session(client, captures=14)  # no program told when
        piece = client.post("/equipment", json={"kind": "sphere", "serial": "S-1"}).json()["id"]
        client.put(f"/equipment/{piece}/certificate", files={"file": ("K.pdf", CERTIFICATE)}).raise_for_status()
        told = {"cell": {"equipment": [{"kind": "sphere", "register_id": piece}]}}
        client.patch(f"/sessions/{session}", json=told).raise_for_status()
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 120}).raise_for_status()
        release = client.post(f"/sessions/{session}/release", json={"why": "night of the audit"}).json()
        dates = of_server(client, session)
        packed = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
        assert client.get(f"/sessions/{session}/archive", params={"scene": False}).content == packed
    assert all(began <= taken <= now() for taken, _ in dates["taken"].values())
    assert {clock for _, clock in dates["taken"].values()} == {"received"}
    assert of_archive(packed) == dates
    file = tmp_path / "session.zip"
    file.write_bytes(packed)
    for command in ("verify", "replay"):
        assert main(["archive", command, str(file)]) == 0
    capsys.readouterr()
    assert main(["report", str(file), "--out", str(tmp_path / "report.html")]) == 0
    words = [f"Release {release['number']} by this machine", "night of the audit", "when the server received them"]
    words += [hashlib.sha256(CERTIFICATE).hexdigest(), f"certificates/{piece}.pdf"]
    with serving(Settings(data=tmp_path / "two", port=0, warm_up=False)) as client:
        there = imported(client, packed)
        assert of_server(client, there) == dates
        again = client.get(f"/sessions/{there}/archive", params={"scene": False}).content
        assert of_archive(again) == dates
        reports = {
            "command": (tmp_path / "report.html").read_text(encoding="utf-8"),
            "server": client.get(f"/sessions/{there}/report").text,
        }
        for name in ("first archive", "second archive"):
            files = dict(entries_of(packed if name.startswith("first") else again))
            reports[name] = next(
                data for info, data in files.items() if info.filename.endswith("report.html")
            ).decode()
    missing = [(name, word) for name, report in reports.items() for word in words if word not in report]
    assert missing == []
    # Of a release that somebody altered in an unpacked archive, nothing is said.
    assert main(["archive", "unpack", str(file), "--out", str(tmp_path / "bag")]) == 0
    forged = tmp_path / "bag" / "data" / "release.json"
    forged.write_text(forged.read_text().replace("night of the audit", "nothing"))
    assert main(["report", str(forged.parent), "--out", str(tmp_path / "forged.html")]) == 0
    assert "No release of this answer is known here." in (tmp_path / "forged.html").read_text(encoding="utf-8")
