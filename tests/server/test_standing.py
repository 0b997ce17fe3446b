"""Faults of the moment: drift, policy, equipment, four eyes; and the evidence of what is in force."""

from pathlib import Path

import httpx
import pytest

from calib_core.review.standing import changed_equipment, serials_of
from tests.server.access import bearer, guarded
from tests.server.live_server import assert_problem, simulated_session, upload
from tests.server.test_webhooks import make_webhook, receiving


def solved_in(client: httpx.Client, cell: str, seed: int = 7, **more: object) -> str:
    """Return a solved session of a cell; another seed is a scanner elsewhere."""
    session = simulated_session(client, seed=seed, captures=14)
    changed = client.patch(f"/sessions/{session}", json={"cell": {"id": cell, **more}})
    assert changed.status_code == 200, changed.text
    client.post(f"/sessions/{session}/solve/tcp", params={"wait": 120}).raise_for_status()
    return session


@pytest.mark.thorough
def test_a_step_is_told_and_refuses_a_release_until_somebody_acknowledges_it(client: httpx.Client) -> None:
    cell = "stepping"
    first = solved_in(client, cell)
    released = client.post(f"/sessions/{first}/release", json={"why": "set up"})
    assert released.status_code == 201, released.text
    before = client.get(f"/cells/{cell}/answer")
    with receiving() as receiver:
        webhook = make_webhook(client, receiver, events=["drift"], cell=cell)["id"]
        second = solved_in(client, cell, seed=8)
        (event,) = receiver.wait_for(1)
        client.delete(f"/webhooks/{webhook}").raise_for_status()
    assert (event["type"], event["session"]) == ("drift", second)
    assert event["data"] == {"cell": cell, "sessions": [second]}
    in_force = client.get(f"/cells/{cell}/answer")
    assert (before.json()["faults"], in_force.json()["faults"]) == ([], ["drift"])
    assert in_force.json()["findings"][0]["code"] == "cell-drifted"
    assert before.headers["ETag"] != in_force.headers["ETag"]
    assert in_force.headers["Scancell-Faults"] == "drift"
    assert client.get(f"/sessions/{second}/answer").json()["faults"] == ["drift"]
    assert_problem(client.post(f"/sessions/{second}/release", json={}), 409, "allow=drift")
    given = client.get(f"/sessions/{first}/exports/abb")  # exports go on, marked
    assert (given.status_code, given.headers["Scancell-Faults"]) == (200, "drift")
    assert "ATTENTION" in given.text
    assert_problem(client.post(f"/cells/{cell}/acknowledge", json={"fault": "stale"}), 422, "drift")
    # By name: whoever it is, no request says it; the reason is the page's to ask for.
    assert_problem(client.post(f"/cells/{cell}/acknowledge", json={"fault": "drift", "who": "he"}), 422, "who")
    told = client.post(f"/cells/{cell}/acknowledge", json={"fault": "drift", "why": "remounted"})
    assert (told.status_code, told.json()["of"], told.json()["why"]) == (200, [second], "remounted")
    assert_problem(client.post(f"/cells/{cell}/acknowledge", json={"fault": "drift"}), 409, "without")
    # Who looks later finds who it was, when and why.
    assert client.get(f"/cells/{cell}/history").json()["acknowledged"] == [told.json()]
    log = client.get("/audit").json()["items"][0]["change"]
    assert log["before"] == {"fault": "drift", "of": [second]}
    assert log["after"]["why"] == "remounted"
    (item,) = [
        one for one in client.get(f"/sessions/{second}/timeline").json()["items"] if one["kind"] == "acknowledged"
    ]
    assert item["message"].startswith("Change of the cell acknowledged by this machine, ")
    assert item["message"].endswith("Reason: remounted")
    assert item["message"] in client.get(f"/sessions/{second}/report").text
    assert client.get(f"/cells/{cell}/answer").json()["faults"] == []
    assert client.post(f"/sessions/{second}/release", json={"why": "new place"}).status_code == 201
    # The answer that was in force when it was acknowledged tells it, too.
    at_first = client.get(f"/sessions/{first}/timeline").json()["items"]
    assert [one["message"] for one in at_first if one["kind"] == "acknowledged"] == [item["message"]]
    client.delete(f"/sessions/{first}").raise_for_status()  # no longer in force
    assert_problem(client.delete(f"/sessions/{second}"), 409, "archived")


@pytest.mark.thorough
def test_policy_and_equipment(client: httpx.Client) -> None:
    cell, scanner = "policed", {"kind": "scanner", "serial": "S-1"}
    first = solved_in(client, cell, equipment=[scanner])
    assert client.get(f"/cells/{cell}/policy").json() == {}
    policy = {"needs": ["verify"], "interval_days": 0.000001}
    assert client.put(f"/cells/{cell}/policy", json=policy).json() == policy
    assert_problem(client.put(f"/cells/{cell}/policy", json={"need": []}), 422, "need")
    log = client.get("/audit").json()["items"]
    entry = next(one for one in log if one["method"] == "PUT" and cell in one["path"])
    assert entry["change"] == {"before": None, "after": policy}
    changed = next(one for one in log if one["method"] == "PATCH" and one["path"].endswith(first))["change"]
    assert changed["after"]["cell.id"] == cell
    assert changed["after"]["cell.equipment"] == [scanner]
    assert client.get(f"/sessions/{first}/answer").json()["faults"] == ["overdue", "verify-undecided"]
    assert_problem(client.post(f"/sessions/{first}/release", json={}), 409, "policy")
    allowed = {"allow": "overdue,verify-undecided"}
    assert client.post(f"/sessions/{first}/release", json=allowed).status_code == 201
    client.put(f"/cells/{cell}/policy", json={})
    assert client.get(f"/cells/{cell}/answer").json()["faults"] == []
    second = solved_in(client, cell, equipment=[{**scanner, "serial": "S-2"}])
    assert client.get(f"/cells/{cell}/answer").json()["faults"] == ["equipment-changed"]
    assert_problem(client.post(f"/sessions/{second}/release", json={}), 409, "equipment-changed")
    acknowledged = client.post(f"/cells/{cell}/acknowledge", json={"fault": "equipment-changed"})
    assert (acknowledged.json()["who"], acknowledged.json()["why"]) == ("this machine", "")
    assert acknowledged.json()["of"] == ["scanner S-1 → scanner S-2"]
    items = client.get(f"/sessions/{second}/timeline").json()["items"]
    told = [one["message"] for one in items if "message" in one]
    assert told[0].startswith("Other equipment (scanner S-1 → scanner S-2) acknowledged by ")
    assert client.post(f"/sessions/{second}/release", json={}).status_code == 201
    # The first one comes back from its repair: that was not acknowledged.
    third = solved_in(client, cell, equipment=[scanner])
    assert client.get(f"/cells/{cell}/answer").json()["faults"] == ["equipment-changed"]
    assert_problem(client.post(f"/sessions/{third}/release", json={}), 409, "equipment-changed")


def test_pieces_without_a_name_are_told_apart_by_their_serial_numbers() -> None:
    before, swapped, other = (
        serials_of([{"kind": "scanner", "serial": one} for one in both])
        for both in (("S-1", "S-2"), ("S-2", "S-1"), ("S-3", "S-2"))
    )
    assert changed_equipment(before, swapped) == frozenset()
    assert changed_equipment(before, other) == {"scanner S-1 → scanner S-3"}
    named = [{"kind": "scanner", "name": "left", "serial": "S-1"}]
    assert changed_equipment(serials_of(named), serials_of([{**named[0], "serial": "S-9"}])) == {
        "scanner left S-1 → scanner left S-9"
    }


@pytest.mark.thorough
def test_four_eyes_and_the_role_release(tmp_path: Path) -> None:
    with guarded(tmp_path) as (client, tokens):
        admin, release, capture = (bearer(tokens[role]) for role in ("admin", "release", "capture"))
        client.headers.update(release)
        session = solved_in(client, "seen-by-two")
        del client.headers["Authorization"]
        policy = "/cells/seen-by-two/policy"
        assert_problem(client.put(policy, json={"four_eyes": True}, headers=release), 403, "admin")
        client.put(policy, json={"four_eyes": True}, headers=admin).raise_for_status()
        here = f"/sessions/{session}/release"
        assert_problem(client.post(here, json={}, headers=capture), 403, "release")
        assert_problem(client.post(here, json={}, headers=release), 409, "four eyes")
        log = client.get("/audit", headers=admin).json()["items"]
        took = [one["change"]["after"]["added"] for one in log if one["path"].endswith("/capture")]
        assert sorted(took) == [[f"p{k:02d}"] for k in range(1, 15)]
        assert client.post(here, json={"why": "second pair"}, headers=admin).status_code == 201

        # Of what came in an archive nobody knows it, whoever adds a capture.
        archive = client.get(f"/sessions/{session}/archive", params={"scene": False}, headers=admin).content
        sent = {**release, "Content-Type": "application/zip"}
        brought = client.post("/archives", content=archive, headers=sent).raise_for_status().json()["id"]
        read = client.get(f"/sessions/{brought}/captures/p01", headers=admin).json()
        file = client.get(f"/sessions/{brought}/captures/p01/files/{read['files'][0]}", headers=admin).content
        told = {name: read[name] for name in ("step", "kind", "pose")}
        own = {**told, "id": "p99", "files": ["captures/p99.csv"]}
        added = upload(client, brought, own, file, headers=release)
        assert added.status_code == 201, added.text
        client.post(f"/sessions/{brought}/solve/tcp", params={"wait": 120}, headers=release).raise_for_status()
        client.patch(f"/sessions/{brought}", json={"cell": {"id": "seen-by-two"}}, headers=release)
        refused = client.post(f"/sessions/{brought}/release", json={"allow": "drift"}, headers=admin)
        assert_problem(refused, 409, "of which it is known who captured it")
