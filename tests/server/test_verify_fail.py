"""A verification that failed: refused by REST, command line and library, unless it is allowed; then marked."""

import json
import zipfile
from io import BytesIO
from pathlib import Path

import httpx
import pytest

import calib_core as cc
from calib_core.errors import ConflictError
from server.cli import main
from tests.server.live_server import assert_problem
from tests.server.test_webhooks import make_webhook, receiving
from tests.verified import verified_session, written


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cell whose scanner was shifted by 1 mm after the calibration, the limit being 0.4 mm."""
    return written(verified_session(3, 1.0), tmp_path_factory.mktemp("failed") / "cell")


@pytest.fixture(scope="module")
def archive(folder: Path) -> bytes:
    packed = folder.parent / "cell.zip"
    assert main(["archive", "pack", str(folder), "--no-scene", "--out", str(packed)]) == 0
    return packed.read_bytes()


def test_the_command_line_and_the_library_refuse_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["answer", str(folder), "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["verdict"], answer["faults"], answer["decision"]) == ("pass", ["verify-fail"], "fail")
    assert main(["export", str(folder), "--format", "kuka"]) == 1
    assert "verification failed" in (said := capsys.readouterr().err)
    assert "--allow verify-fail" in said
    assert main(["export", str(folder), "--format", "kuka", "--allow", "stale"]) == 1
    capsys.readouterr()
    assert main(["export", str(folder), "--format", "kuka", "--allow", "stale,fail,verify-fail"]) == 0
    assert "NOT TO BE USED: this answer is not confirmed by its verification" in capsys.readouterr().out
    with pytest.raises(ConflictError, match="verification failed"):
        cc.load(folder).export("json")


def test_rest_refuses_export_release_and_rollback(client: httpx.Client, archive: bytes) -> None:
    made = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"}).json()
    here, cell = f"/sessions/{made['id']}", "cell-that-failed"
    client.patch(here, json={"cell": {"id": cell}})
    answer = client.get(f"{here}/answer")
    assert answer.json()["faults"] == ["verify-fail"]
    assert answer.headers["Scancell-Faults"] == "verify-fail"
    assert_problem(client.get(f"{here}/exports/abb"), 409, "verify-fail")
    assert_problem(client.get(f"{here}/exports/check-move", params={"allow": "verify-fail"}), 409, "verification")
    given = client.get(f"{here}/exports/abb", params={"allow": "verify-fail"})
    assert "NOT TO BE USED" in given.text
    assert given.headers["Scancell-Faults"] == "verify-fail"
    assert_problem(client.post(f"{here}/release", json={"why": "night"}), 409, "allow=verify-fail")
    assert_problem(client.post(f"{here}/release", json={"allow": "verified"}), 422, "verify-fail")
    released = client.post(f"{here}/release", json={"why": "on trial", "allow": "verify-fail"})
    assert released.status_code == 201, released.text
    assert (released.json()["in_spite_of"], released.json()["signed"]) == (["verify-fail"], True)
    report = client.get(f"{here}/report").text
    assert "It was released in spite of this: The answer&#39;s latest verification failed its limits." in report
    assert client.get(f"/cells/{cell}/answer").headers["Scancell-Faults"] == "verify-fail"
    # Rolling back to it asks as the release did.
    number = {"number": released.json()["number"], "why": "back"}
    assert_problem(client.post(f"/cells/{cell}/rollback", json=number), 409, "verify-fail")
    back = client.post(f"/cells/{cell}/rollback", json={**number, "allow": "verify-fail"})
    assert back.status_code == 201

    # A verification that is out of date still failed: only another one undoes it.
    client.patch(here, json={"cell": {"verification": {"tool_mm": 5.0}}})
    assert "verify-fail" in client.get(f"{here}/answer").json()["faults"]
    client.post(f"{here}/solve/verify", params={"wait": 60})
    eased = client.get(f"{here}/answer").json()
    assert (eased["faults"], len(eased["limits_changed"])) == ([], 1)
    with zipfile.ZipFile(BytesIO(archive)) as packed:
        (name,) = (name for name in packed.namelist() if name.endswith("data/answer.json"))
        assert json.loads(packed.read(name))["faults"] == ["verify-fail"]


def test_a_capture_that_was_left_out_after_a_decision_is_told(client: httpx.Client, archive: bytes) -> None:
    made = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"}).json()
    here = f"/sessions/{made['id']}"
    with zipfile.ZipFile(BytesIO(archive)) as packed:
        (name,) = (name for name in packed.namelist() if name.endswith("results/tcp.json"))
        solved = json.loads(packed.read(name))["solved"]
    before = client.get(f"{here}/answer").json()
    assert (before["solved"], before["decided_before"]) == (solved, [])  # nothing turns into today
    left_out = {"excluded": True, "excluded_because": {"why": "the sphere was touched"}}
    changed = client.patch(f"{here}/captures/p20", json=left_out).json()
    assert (changed["excluded_because"]["who"], changed["excluded_because"]["why"]) == (
        "this machine",
        "the sphere was touched",
    )
    with receiving() as receiver:
        webhook = make_webhook(client, receiver, events=["verify-fail"])["id"]
        client.post(f"{here}/solve/verify", params={"wait": 60}).raise_for_status()
        (event,) = receiver.wait_for(1)
        client.delete(f"/webhooks/{webhook}").raise_for_status()
    assert (event["type"], event["session"], event["data"]["decision"]) == ("verify-fail", made["id"], "fail")
    (told,) = client.get(f"{here}/answer").json()["decided_before"]
    assert (told["decision"], told["added"], told["limits"]) == ("fail", [], [])
    assert told["left_out"] == [{"capture": "p20", "because": changed["excluded_because"]}]
    items = client.get(f"{here}/timeline").json()["items"]
    assert [one["excluded_because"] for one in items if one.get("excluded_because")] == [
        changed["excluded_because"]
    ]
    again = client.patch(f"{here}/captures/p20", json={"excluded": False}).json()
    assert "excluded_because" not in again
    # So is another calibration that the same captures are held against until it passes.
    client.patch(f"{here}/captures/p03", json={"excluded": True}).raise_for_status()
    client.post(f"{here}/solve/all", params={"wait": 60}).raise_for_status()
    *_, last = client.get(f"{here}/answer").json()["decided_before"]
    assert ([one["capture"] for one in last["left_out"]], last["added"]) == (["p03"], ["p20"])
