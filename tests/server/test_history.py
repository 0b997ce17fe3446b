"""A session's past: time line, moments, the history of results, comparisons, recomputing."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest

from calib_core.archive.archive import pack
from calib_core.archive.folder import to_json_bytes
from calib_core.simulation import simulate
from server.store.history import _session_then
from tests.server.live_server import assert_problem, simulated_session, wait_for


def solve(client: httpx.Client, session: str, stage: str = "tcp") -> dict[str, Any]:
    return wait_for(client, client.post(f"/sessions/{session}/solve/{stage}").json()["id"])


@pytest.fixture(scope="module")
def session(shared_client: httpx.Client) -> str:
    """Eleven captures, a solve; one left out, one taken anew, a solve; one more left out, one removed."""
    client = shared_client
    session = simulated_session(client, captures=11)
    assert solve(client, session)["status"] == "done"
    client.patch(f"/sessions/{session}/captures/p03", json={"excluded": True})
    client.delete(f"/sessions/{session}/captures/p10")
    client.post(f"/sessions/{session}/sources/simulated/capture")
    assert solve(client, session)["status"] == "done"
    client.patch(f"/sessions/{session}/captures/p04", json={"excluded": True})
    client.delete(f"/sessions/{session}/captures/p11")
    return session


@pytest.mark.thorough
def test_the_time_line_has_everything_in_order(client: httpx.Client, session: str) -> None:
    items = client.get(f"/sessions/{session}/timeline").json()["items"]
    assert [item["place"] for item in items] == list(range(len(items)))
    assert [item["at"] for item in items] == sorted(item["at"] for item in items)
    told = [item.get("capture") or item.get("stage") or item["kind"] for item in items]
    # Those removed since stand before the solve that used them.
    assert set(told[:11]) == {f"p{k:02d}" for k in range(1, 12)}
    assert told[11:] == ["tcp", "p10", "p10", "tcp", "p11", "now"]  # p10 is removed, then captured anew
    assert [item["place"] for item in items if item["kind"] == "removed"] == [12, 15]
    assert [item["capture"] for item in items if item.get("removed")] == ["p10", "p11"]


@pytest.mark.thorough
def test_each_moment_is_as_it_was(client: httpx.Client, session: str) -> None:
    def at(place: int) -> dict[str, Any]:
        return client.get(f"/sessions/{session}/timeline/{place}").json()

    def left_out(moment: dict[str, Any]) -> list[str]:
        return [c["id"] for c in moment["captures"] if c.get("excluded")]

    three = at(2)
    assert len(three["captures"]) == 3
    assert (three["results"], three["frames"]) == ({}, None)
    assert three["guide"]["current"]["action"] == "capture"
    first = at(11)
    assert len(first["captures"]) == 11
    assert left_out(first) == []
    assert first["results"]["tcp"]["stale"] is False
    assert first["frames"]["conventions"]["fanuc"]["numbers"]
    removed = next(c for c in first["captures"] if c["id"] == "p10")
    assert "removed since" in removed["measured"]["reason"]
    second = at(14)
    assert left_out(second) == ["p03"]
    assert len(second["captures"]) == 11
    now = at(16)
    assert left_out(now) == ["p03", "p04"]
    assert len(now["captures"]) == 10
    assert now["results"]["tcp"]["stale"] is True
    assert first["numbers"]["tcp"] < second["numbers"]["tcp"] == now["numbers"]["tcp"]


def test_a_moment_has_no_capture_that_the_next_solve_did_not_find() -> None:
    whole = simulate("tcp", 1).session
    fewer = whole.model_copy(update={"captures": whole.captures[1:]})
    ids = [capture.id for capture in whole.captures]
    assert [one.id for one in _session_then(fewer, ids, [whole], [fewer]).captures] == ids[1:]
    assert [one.id for one in _session_then(fewer, ids, [], [whole, fewer]).captures] == ids


def test_every_result_is_kept(client: httpx.Client, session: str) -> None:
    items = client.get(f"/sessions/{session}/results/tcp/history").json()["items"]
    assert len(items) == 2
    assert items[0]["number"] > items[1]["number"]
    assert (items[1]["captures"], items[0]["captures"]) == (11, 11)
    assert items[0]["figures"]["surface_rms_mm"] > 0
    old = client.get(f"/sessions/{session}/results/tcp/history/{items[1]['number']}").json()
    latest = client.get(f"/sessions/{session}/results/tcp").json()
    assert old["inputs_sha256"] == items[1]["inputs_sha256"] != latest["inputs_sha256"]
    assert latest["at_workpiece"][0]["worst_sigma_mm"] > 0


def test_two_solves_side_by_side(client: httpx.Client, session: str) -> None:
    new, old = (i["number"] for i in client.get(f"/sessions/{session}/results/tcp/history").json()["items"])
    found = client.get("/compare/tcp", params={"left": f"{session}:{old}", "right": f"{session}:{new}"}).json()
    told = [(change["kind"], change["what"]) for change in found["changes"]]
    assert told == [("left-out", "p03"), ("changed", "p10 taken")]  # p10 was captured anew
    assert found["shared"] == 10
    (frame,) = found["frames"]
    assert 0 < frame["distance"] < 4
    assert frame["at_workpiece_mm"] < 4 * frame["at_workpiece_sigma_mm"]
    row = next(r for r in found["residuals"] if r["capture"] == "p03")
    assert (row["left_used"], row["right_used"]) == (True, False)
    scene = f"{str(client.base_url).removesuffix('/api/v1/')}/scenes/{session}"
    both = {"stage": "tcp", "left": f"{session}:{old}", "right": f"{session}:{new}"}
    assert client.post(f"{scene}.page4711/compared", json=both).status_code == 204
    assert client.get(f"{scene}.page4711/page").status_code == 200
    assert_problem(client.post(f"{scene}/compared", json=both), 404, "SESSION.NAME")
    assert_problem(client.post(f"{scene}.page4711/compared", json={**both, "right": f"{session}:999"}), 404, "999")


def test_two_sessions_side_by_side(client: httpx.Client, session: str) -> None:
    other = simulated_session(client, captures=14, seed=8)
    assert solve(client, other)["status"] == "done"
    found = client.get("/compare/tcp", params={"left": session, "right": other}).json()
    assert found["shared"] == 0
    assert (found["left"]["session"], found["right"]["session"]) == (session, other)
    # Another seed is another cell: its scanner sits elsewhere by far more than the uncertainty.
    assert found["frames"][0]["distance"] > 20
    assert found["frames"][0]["chance"] < 1e-6


@pytest.mark.thorough
def test_recomputing_gives_the_stored_numbers_and_changes_nothing(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14)
    solve(client, session)
    before = client.get(f"/sessions/{session}/timeline").json()
    job = client.post(f"/sessions/{session}/replay").json()
    assert wait_for(client, job["id"])["status"] == "done"
    answer = client.get(f"/jobs/{job['id']}/answer").json()
    assert answer["replay"]["equal"] is True
    assert answer["replay"]["stages"][0]["largest_relative"] <= 1e-9
    assert answer["stages"]["tcp"]["frames"][0]["at_workpiece_mm"] == 0
    after = client.get(f"/sessions/{session}/timeline").json()
    assert [i for i in after["items"] if i["kind"] != "now"] == [i for i in before["items"] if i["kind"] != "now"]


def test_a_failed_solve_is_on_the_time_line(client: httpx.Client) -> None:
    session = simulated_session(client, captures=1)
    assert solve(client, session)["status"] == "failed"
    item = client.get(f"/sessions/{session}/timeline").json()["items"][1]
    assert (item["kind"], item["stage"]) == ("failed", "tcp")
    assert item["message"]


def send_archive(client: httpx.Client, archive: bytes) -> httpx.Response:
    return client.post("/archives", content=archive, headers={"Content-Type": "application/zip"})


def test_an_archive_brings_its_past_along(client: httpx.Client, session: str) -> None:
    archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
    made = send_archive(client, archive).json()["id"]

    def told(id_: str) -> list[tuple[Any, ...]]:
        items = client.get(f"/sessions/{id_}/timeline").json()["items"]
        return [
            tuple(i.get(n) for n in ("kind", "at", "capture", "stage", "verdict", "removed")) for i in items[:-1]
        ]

    assert told(made) == told(session)
    first = client.get(f"/sessions/{made}/timeline/11").json()
    assert (len(first["captures"]), first["results"]["tcp"]["stale"]) == (11, False)
    old, new = reversed(client.get(f"/sessions/{made}/results/tcp/history").json()["items"])
    sides = {"left": f"{made}:{old['number']}", "right": f"{made}:{new['number']}"}
    assert client.get("/compare/tcp", params=sides).json()["changes"][0]["what"] == "p03"
    # And out again, the same.
    again = client.get(f"/sessions/{made}/archive", params={"scene": False}).content
    assert history_in(again) == history_in(archive)


def history_in(archive: bytes) -> Any:
    with zipfile.ZipFile(io.BytesIO(archive)) as packed:
        name = next(name for name in packed.namelist() if name.endswith("data/history.json"))
        return json.loads(packed.read(name))


@pytest.mark.parametrize(
    ("history", "word"),
    [
        (b"{", "JSON"),
        (b"[]", "history"),
        (b'{"format": "scancell-history/9"}', "scancell-history/1"),
        (b'{"captures": {"p01": "yesterday"}}', "p01"),
        (b'{"results": [{"stage": "dance", "created": "2026-01-01T00:00:00.000Z"}]}', "stage"),
        (
            b'{"results": [{"stage": "tcp", "created": "2026-01-01T00:00:00.000Z", "record": {"stage": "tcp"}}]}',
            "method",
        ),
        (
            b'{"results": [{"stage": "tcp", "created": "2026-01-01T00:00:00.000Z", '
            b'"solved_from": {"session": {}, "files": {}}}]}',
            "cell",
        ),
    ],
)
def test_a_past_that_is_none_is_refused(client: httpx.Client, tmp_path: Path, history: bytes, word: str) -> None:
    made = simulate("tcp", 4)
    folder = tmp_path / "cell"
    (folder / "captures").mkdir(parents=True)
    (folder / "session.json").write_bytes(to_json_bytes(made.session.to_json()))
    for name, content in made.files.items():
        (folder / name).write_bytes(content)
    (folder / "history.json").write_bytes(history)
    pack(folder, tmp_path / "cell.zip")
    before = client.get("/sessions").json()
    assert_problem(send_archive(client, (tmp_path / "cell.zip").read_bytes()), 422, word)
    assert client.get("/sessions").json() == before


def test_what_is_not_there_says_so(client: httpx.Client, session: str) -> None:
    assert_problem(client.get(f"/sessions/{session}/timeline/99"), 404, "time line")
    assert_problem(client.get("/sessions/none/timeline"), 404)
    assert_problem(client.get(f"/sessions/{session}/results/tcp/history/999999"), 404, "history")
    assert_problem(client.get("/sessions/none/results/tcp/history"), 404)
    assert_problem(client.get("/compare/tcp", params={"left": f"{session}:x", "right": session}), 422, "SESSION")
    assert_problem(client.get("/compare/camera", params={"left": session, "right": session}), 404, "not solved")
    job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
    wait_for(client, job)
    assert_problem(client.get(f"/jobs/{job}/answer"), 404)
    empty = simulated_session(client)
    assert_problem(client.post(f"/sessions/{empty}/replay"), 409, "Solve the session first")
