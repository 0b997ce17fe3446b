"""Released answers: what is in force for a cell stays as it was, and says who put it there."""

import json
from itertools import islice

import httpx
import pytest

from scancell_client import Scancell
from server.cli import main
from tests.server.live_server import assert_problem, make_session, simulated_session


@pytest.mark.thorough
def test_a_release_is_in_force_until_another_is_and_can_be_rolled_back(client: httpx.Client) -> None:
    name = {"name": "Cell of Releases"}
    session = simulated_session(client, captures=14)
    client.patch(f"/sessions/{session}", json=name)
    cell = "cell-of-releases"
    assert_problem(client.get(f"/cells/{cell}/answer"), 404, "release")
    assert_problem(client.post(f"/sessions/{session}/release", json={}), 409, "Solve")
    client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60})
    first = client.post(f"/sessions/{session}/release", json={"why": "set up"})
    assert first.status_code == 201, first.text
    assert (first.json()["cell"], first.json()["who"]) == (cell, "this machine")
    answer, result = (client.get(f"/sessions/{session}/{what}").json() for what in ("answer", "results/tcp"))
    (headline,) = (block for block in result["evidence"] if block.get("headline"))
    told = first.json()
    assert told["workpiece_sigma_mm"] == pytest.approx(headline["quantity"]["uncertainty"] / 2)
    assert (told["solved"], told["inputs_sha256"]) == (answer["solved"], answer["inputs_sha256"])
    there = client.get(first.headers["Location"].removeprefix("/api/v1"))
    assert there.headers["ETag"] == first.headers["ETag"]
    in_force = there.json()
    assert in_force["tool0_from_laser"] == client.get(f"/sessions/{session}/answer").json()["tool0_from_laser"]

    client.patch(f"/sessions/{session}/captures/p03", json={"excluded": True})
    assert client.get(f"/cells/{cell}/answer").json() == in_force  # what is changed later does not touch it
    assert_problem(client.post(f"/sessions/{session}/release", json={}), 409, "stale")
    client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60})
    second = client.post(f"/sessions/{session}/release", json={"why": "p03 was bumped"}).json()
    assert client.get(f"/cells/{cell}/answer").json() != in_force

    back = client.post(f"/cells/{cell}/rollback", json={"why": "scans are off"}).json()
    assert back["action"] == "rollback"
    assert client.get(f"/cells/{cell}/answer").json() == in_force
    again = client.post(f"/cells/{cell}/rollback", json={"number": second["number"]}).json()
    history = client.get(f"/cells/{cell}/history").json()
    assert [r["number"] for r in history["releases"]] == [
        again["number"], back["number"], second["number"], first.json()["number"],
    ]  # fmt: skip
    assert [s["id"] for s in history["sessions"]] == [session]
    (listed,) = (c for c in client.get("/cells").json()["items"] if c["id"] == cell)
    assert listed["released"]["number"] == again["number"]
    # Each is told in the stream of every session of the cell, so that open pages show it.
    with Scancell(str(client.base_url).removesuffix("/").removesuffix("/api/v1"), trust_env=False) as api:
        releases = (event.data for event in api.events(session, after=0) if event.kind == "release")
        assert list(islice(releases, 4)) == [first.json(), second, back, again]
    for evidence in (f"/sessions/{session}", f"/sessions/{session}/captures/p04"):
        assert_problem(client.delete(evidence), 409, "archived")  # what is in force keeps its evidence


@pytest.mark.thorough
def test_a_cell_s_drift_has_its_solved_sessions_and_says_what_changed(
    client: httpx.Client, capsys: pytest.CaptureFixture[str]
) -> None:
    sessions = [simulated_session(client, seed=seed, captures=14) for seed in (7, 8)]
    for session in sessions:
        client.patch(f"/sessions/{session}", json={"name": "Cell that drifts"})
        client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60})
    found = client.get("/cells/cell-that-drifts/drift").json()
    tool = next(one for one in found["series"] if one["figure"] == "tool")
    assert [point["session"] for point in tool["points"]] == sessions
    assert tool["points"][1]["flagged"]  # another seed is another cell: its scanner sits elsewhere
    assert "more than uncertainty explains" in found["flags"][0]
    assert_problem(client.get("/cells/none/drift"), 404, "none")

    def listed_as_stale() -> list[list[str]]:
        items = client.get("/sessions", params={"search": "cell that drifts"}).json()["items"]
        return [item["stale"] for item in items]

    assert listed_as_stale() == [[], []]
    changed = f"/sessions/{sessions[1]}/captures/p03"
    client.patch(changed, json={"excluded": True})
    assert listed_as_stale() == [["tcp"], []]  # the newest first
    without = client.get("/cells/cell-that-drifts/drift").json()
    assert [[point["session"] for point in one["points"]] for one in without["series"]] == [[sessions[0]]] * 2
    assert (without["flags"], list(without["left_out"])) == ([], [sessions[1]])
    assert "out of date" in without["left_out"][sessions[1]]
    client.patch(changed, json={"excluded": False})
    assert listed_as_stale() == [[], []]
    site = str(client.base_url).removesuffix("/api/v1/")
    capsys.readouterr()
    assert main(["drift", "cell-that-drifts", "--server", site, "--json"]) == (1 if found["flags"] else 0)
    assert json.loads(capsys.readouterr().out) == found
    assert main(["drift", "none", "--server", site]) == 2
    assert "none" in capsys.readouterr().err


def test_cells_that_are_not_there_say_so(client: httpx.Client) -> None:
    assert_problem(client.get("/cells/none/history"), 404, "none")
    assert_problem(client.post("/cells/none/rollback", json={}), 404, "none")
    make_session(client, name="A cell / 5")
    assert "a-cell-5" in {cell["id"] for cell in client.get("/cells").json()["items"]}
    assert_problem(client.post("/cells/a-cell-5/rollback", json={"wy": "x"}), 422, "why")
