"""Limits of a verification that are changed after its first capture: kept and told."""

import io
import json
import zipfile

import httpx

from tests.server.live_server import assert_problem, simulated_session


def test_a_late_change_of_limits_is_kept_and_told_wherever_the_decision_stands(client: httpx.Client) -> None:
    session = simulated_session(client, scenario="verify", captures=0)
    here = f"/sessions/{session}"

    def limits(**values: object) -> httpx.Response:
        return client.patch(here, json={"cell": {"verification": values}})

    assert "changes" not in limits(tool_mm=0.2).json()["cell"]["verification"]  # before the first capture
    for _ in range(4):
        taken = client.post(f"{here}/sources/simulated/capture", params={"step": "verify"})
        assert taken.status_code == 201, taken.text
    changed = limits(tool_mm=90.0).json()["cell"]["verification"]
    (one,) = changed["changes"]
    told = {name: one[name] for name in ("who", "field", "before_mm", "after_mm", "captures")}
    assert told == {"who": "this machine", "field": "tool_mm", "before_mm": 0.2, "after_mm": 90.0, "captures": 4}
    assert len(one["at"]) == 24
    again = limits(tool_mm=90.0, size_mm=90.0).json()["cell"]["verification"]
    assert again["changes"][0] == one
    assert [c["field"] for c in again["changes"]] == ["tool_mm", "size_mm"]

    for tampered in ([], None, [{**one, "captures": 1}]):
        assert_problem(limits(changes=tampered), 422, "kept by the server")
    assert client.patch(here, json={"cell": {"verification": again}}).status_code == 200  # as it was read
    dropped = client.patch(here, json={"cell": {"verification": None}}).json()["cell"]["verification"]
    assert dropped["changes"][:2] == again["changes"]
    assert {(c["field"], c["after_mm"]) for c in dropped["changes"][2:]} >= {("tool_mm", None), ("size_mm", None)}

    archive = client.get(f"{here}/archive")
    with zipfile.ZipFile(io.BytesIO(archive.content)) as bag:
        (name,) = (one for one in bag.namelist() if one.endswith("data/session.json"))
        record = json.loads(bag.read(name))
    assert record["cell"]["verification"]["changes"] == dropped["changes"]


def test_an_approval_without_a_reason_is_kept_as_one_without(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14)
    client.patch(f"/sessions/{session}", json={"name": "Cell without reasons"})
    client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60})
    release = client.post(f"/sessions/{session}/release", json={"why": "   "})
    assert (release.status_code, release.json()["why"]) == (201, "")


def test_the_reason_for_captures_after_a_decision_stays_with_them(client: httpx.Client) -> None:
    session = simulated_session(client, scenario="verify", captures=0)
    here, take = f"/sessions/{session}", f"/sessions/{session}/sources/simulated/capture"
    for step in (*["tcp"] * 8, *["verify"] * 4):
        client.post(take, params={"step": step}).raise_for_status()
    client.post(f"{here}/solve/all", params={"wait": 60}).raise_for_status()
    last = client.post(take, params={"step": "verify", "why": "too few decide"}).raise_for_status().json()
    told = last["added_because"]
    assert (told["who"], told["why"], len(told["when"])) == ("this machine", "too few decide", 24)
    client.post(f"{here}/solve/verify", params={"wait": 60}).raise_for_status()
    (before,) = client.get(f"{here}/answer").json()["decided_before"]
    assert [(one["capture"], one["because"]) for one in before["came"]] == [(last["id"], told)]
