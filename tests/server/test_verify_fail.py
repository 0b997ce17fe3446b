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
from tests.server.live_server import assert_problem, upload
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
    (left_out,) = told["left_out"]
    assert (left_out["capture"], left_out["because"]) == ("p20", changed["excluded_because"])
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


def test_whatever_changed_after_a_decision_is_told_with_who_when_and_why(
    client: httpx.Client, archive: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sent = {"Content-Type": "application/zip"}
    here = f"/sessions/{client.post('/archives', content=archive, headers=sent).json()['id']}"
    read = client.get(f"{here}/captures/p21").json()
    file = client.get(f"{here}/captures/p21/files/{read['files'][0]}").content
    client.delete(f"{here}/captures/p20", params={"why": "touched"}).raise_for_status()
    client.delete(f"{here}/captures/p21", params={"why": "badly seen"}).raise_for_status()
    again = {**read, "added_because": {"who": "somebody", "why": "seen well"}}
    better = upload(client, here.rpartition("/")[2], again, file)
    assert better.status_code == 201, better.text
    told = client.get(f"{here}/captures/p22").json()["pose"]
    turned = [told[0] + 0.2, *told[1:]]
    reason = {"who": "somebody", "why": "misread"}
    patched = client.patch(f"{here}/captures/p22", json={"pose": turned, "changed_because": reason})
    assert patched.status_code == 200, patched.text
    assert patched.json()["changed_because"]["who"] == "this machine", patched.text
    forged = {"excluded_because": {"who": "somebody"}, "added_because": {"who": "somebody"}}
    assert not client.patch(f"{here}/captures/p23", json=forged).json().keys() & forged.keys()
    assert_problem(client.patch(here, json={"removed": []}), 422, "kept by the server")
    job = client.post(f"{here}/solve/verify", params={"wait": 60}).raise_for_status().json()
    assert job["status"] == "done", job["error"]
    client.patch(f"{here}/captures/p23", json={"mount": "low"}).raise_for_status()
    client.patch(f"{here}/captures/p23", json={"pose": turned, "mount": read["mount"]}).raise_for_status()
    diameter_mm = client.get(here).json()["cell"]["sphere_diameter_mm"] + 0.001
    client.patch(here, json={"cell": {"sphere_diameter_mm": diameter_mm}}).raise_for_status()
    job = client.post(f"{here}/solve/verify", params={"wait": 60}).raise_for_status().json()
    assert job["status"] == "done", job["error"]

    said = (
        "Then removed for good: p20. By this machine (", "reason: touched.",
        "Then removed for good: p21.", "reason: badly seen.",
        "Then added: p21. By this machine (", "reason: seen well.",
        "Then changed: p22. By this machine (", "reason: misread.",
        "Then changed: p23 (pose). By this machine (", "reason: none given.",
        "Then the cell was changed: sphere_diameter_mm.",
    )  # fmt: skip
    answer = client.get(f"{here}/answer").json()
    kept = client.get(f"{here}/archive", params={"scene": False}).content
    brought = f"/sessions/{client.post('/archives', content=kept, headers=sent).json()['id']}"
    packed = tmp_path / "kept.zip"
    packed.write_bytes(kept)
    main(["answer", str(packed)])
    assert client.get(f"{here}/results/verify").json()["decided_before"] == answer["decided_before"]
    told = " ".join(one["text"] for one in answer["decided_before"])
    texts = (told, client.get(f"{here}/report").text, capsys.readouterr().out)
    for text in (*texts, client.get(f"{brought}/report").text):
        assert [words for words in said if words not in " ".join(text.split())] == []
    items = client.get(f"{brought}/timeline").json()["items"]
    deeds = {name: [one[name] for one in items if one.get(name)] for name in ("removed_because", "added_because")}
    assert [(one["who"], one["why"]) for one in deeds["removed_because"]] == [
        ("this machine", "touched"), ("this machine", "badly seen"),
    ]  # fmt: skip
    assert [one["why"] for one in deeds["added_because"]] == ["seen well"]
