"""Dates last: when it was captured and solved is the same in folder, archives, import, report, restored store."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from calib_core.moment import now
from server.cli import main
from server.settings import Settings
from tests.core.archives import entries_of
from tests.server.dated_session import SOLVED, elsewhere, imported, journey, of_archive, of_server
from tests.server.live_server import serving, simulated_session


@pytest.fixture(name="elsewhere")
def _elsewhere() -> Iterator[None]:
    with elsewhere():
        yield


@pytest.mark.thorough
@pytest.mark.usefixtures("elsewhere")
def test_dates_are_the_same_wherever_a_session_goes(tmp_path: Path) -> None:
    found = journey(tmp_path)
    report = found.pop("report")["text"]
    told = found["folder"]
    assert told["solved"] == SOLVED
    assert set(told["results"].values()) == {SOLVED}
    assert all(taken.startswith("2025-03-30T01:") for taken, _ in told["taken"].values())
    assert {clock for _, clock in told["taken"].values()} == {"device"}
    assert {place: dates for place, dates in found.items() if dates != told} == {}
    assert "2025-04-01 08:15 UTC" in report
    assert "2025-03-30 01:00 UTC+01:00" in report
    assert "UTC+01:00 (the device" in report


CERTIFICATE = b"%PDF-1.7 K-123"


@pytest.mark.thorough
@pytest.mark.usefixtures("elsewhere")
def test_an_auditor_finds_dates_release_and_certificate_in_the_archive_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    began = now()
    with serving(Settings(data=tmp_path / "one", port=0, warm_up=False)) as client:
        session = simulated_session(client, captures=14)  # no program told when
        piece = client.post("/equipment", json={"kind": "sphere", "serial": "S-1"}).json()["id"]
        client.put(f"/equipment/{piece}/certificate", files={"file": ("K.pdf", CERTIFICATE)}).raise_for_status()
        sphere, cell = {"kind": "sphere", "register_id": piece}, "audited"

        def with_scanner(serial: str) -> None:
            told = {"id": cell, "equipment": [sphere, {"kind": "scanner", "serial": serial}]}
            client.patch(f"/sessions/{session}", json={"cell": told}).raise_for_status()

        with_scanner("N-1")
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 120}).raise_for_status()
        release = client.post(f"/sessions/{session}/release", json={"why": "night of the audit"}).json()
        with_scanner("N-2")
        spare = {"fault": "equipment-changed", "why": "spare"}
        client.post(f"/cells/{cell}/acknowledge", json=spare).raise_for_status()
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
    words += ["Other equipment (scanner N-1 → scanner N-2) acknowledged by this machine", "Reason: spare"]
    words += [hashlib.sha256(CERTIFICATE).hexdigest(), f"certificates/{piece}.pdf"]
    with serving(Settings(data=tmp_path / "two", port=0, warm_up=False)) as client:
        there = imported(client, packed)
        assert of_server(client, there) == dates
        again = client.get(f"/sessions/{there}/archive", params={"scene": False}).content
        assert of_archive(again) == dates
        items = client.get(f"/sessions/{there}/timeline").json()["items"]
        (acknowledged,) = (one["message"] for one in items if one["kind"] == "acknowledged")
        assert acknowledged.endswith("Reason: spare")
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
    report = (tmp_path / "forged.html").read_text(encoding="utf-8")
    assert "No release of this answer is known here." in report
    assert "acknowledged by" not in report
