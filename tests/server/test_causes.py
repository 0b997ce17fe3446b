"""Root causes over REST: asked for, applied with one call, undone with the changes that it answered."""

from pathlib import Path

import httpx
import pytest

from server.settings import Settings
from tests.server.live_server import serving, wait_for


@pytest.fixture
def client(tmp_path: Path):
    with serving(Settings(data=tmp_path)) as client:
        yield client


def simulated(client: httpx.Client, convention: str) -> str:
    body = {"name": "wrong", "simulated": {"scenario": "tcp-centers", "seed": 11}}
    session = client.post("/sessions", json=body).json()["id"]
    while client.post(f"/sessions/{session}/sources/simulated/capture").status_code == 201:
        pass
    client.patch(f"/sessions/{session}", json={"cell": {"pose_convention": convention}}).raise_for_status()
    return session


def solved(client: httpx.Client, session: str) -> dict:
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    assert wait_for(client, job, 300)["status"] == "done"
    return client.get(f"/sessions/{session}/results/tcp").json()


@pytest.mark.thorough
def test_a_cause_is_applied_with_one_call_and_undone(client: httpx.Client) -> None:
    session = simulated(client, "quaternion-xyzw")
    before = client.get(f"/sessions/{session}").json()
    failed = solved(client, session)
    assert failed["verdict"] == "fail"
    (cause,) = client.get(f"/sessions/{session}/causes").json()["items"]
    assert cause["changes"]["cell"] == {"pose_convention": "quaternion-wxyz"}
    key = {"Idempotency-Key": "once"}
    answer = client.post(f"/sessions/{session}/causes/{cause['id']}/apply", headers=key)
    assert answer.status_code == 200
    assert answer.json()["session"]["cell"]["pose_convention"] == "quaternion-wxyz"
    again = client.post(f"/sessions/{session}/causes/{cause['id']}/apply", headers=key)
    assert again.json() == answer.json()
    assert solved(client, session)["verdict"] != "fail"
    assert client.get(f"/sessions/{session}/causes").json()["items"] == []
    undone = client.post(f"/sessions/{session}/changes", json=answer.json()["undo"])
    assert undone.status_code == 200
    after = client.get(f"/sessions/{session}").json()
    assert after["cell"] == before["cell"]
    assert after["captures"] == before["captures"]


def test_what_cannot_be_applied_is_refused_and_changes_nothing(client: httpx.Client) -> None:
    session = simulated(client, "abb")
    before = client.get(f"/sessions/{session}").json()
    refused = [
        client.post(f"/sessions/{session}/changes", json={"captures": {"none": {"excluded": True}}}),
        client.post(f"/sessions/{session}/changes", json={"captures": {"p01": {"id": "p02"}}}),
        client.post(f"/sessions/{session}/changes", json={"captures": {"p01": {"pose": [1, 2]}}}),
        client.post(f"/sessions/{session}/changes", json={"cell": {"sphere_diameter": 3}}),
    ]
    assert [answer.status_code for answer in refused] == [422] * 4
    assert all(answer.json()["detail"] for answer in refused)
    assert client.get(f"/sessions/{session}").json() == before
