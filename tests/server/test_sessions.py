"""Sessions over REST: made, read, listed, changed, removed."""

import httpx
import pytest

from tests.server.live_server import assert_problem, make_session, simulated_session


def test_a_session_comes_back_field_for_field(client: httpx.Client) -> None:
    cell = {
        "pose_convention": "kuka",
        "sphere_diameter_mm": 80.0,
        "scanner": {"kind": "profile", "z_axis": "toward"},
        "robot": {"brand": "KUKA"},
    }
    about = {"documentation": {"operator": "Ada"}, "environment": {"ball_c": 21.5}}
    made = client.post("/sessions", json={"name": "Zelle 4 – früh", "cell": cell, **about})
    assert made.status_code == 201
    got = client.get(f"/sessions/{made.json()['id']}")
    assert got.json() == made.json()
    assert got.json()["cell"] == cell
    assert {name: got.json()[name] for name in about} == about
    assert got.json()["name"] == "Zelle 4 – früh"
    assert got.json()["captures"] == []
    assert got.json()["simulated"] is False
    assert got.json()["scene"] == f"/scenes/{made.json()['id']}/"


def test_a_simulated_session_brings_its_cell(client: httpx.Client) -> None:
    record = client.get(f"/sessions/{simulated_session(client)}").json()
    assert record["simulated"] is True
    assert record["cell"]["sphere_diameter_mm"] == 40.0
    assert record["captures"] == []


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"name": "no cell"}, ["cell"]),
        ({"cell": {"pose_convention": "fanuk"}}, ["fanuc", "kuka", "ros", "fanuk"]),
        ({"cell": {"pose_convention": "ur", "sphere_diameter_mm": -3}}, ["sphere_diameter_mm", "-3"]),
        ({"cell": {"pose_convention": "ur"}, "captures": [{"id": "p01"}]}, ["captures"]),
        ({"simulated": {"scenario": "moonbase"}}, ["moonbase", "tcp"]),
        ({"format": "scancell-session/9", "cell": {"pose_convention": "ur"}}, ["scancell-session/1"]),
        ([1, 2], ["request"]),
    ],
)
def test_unusable_sessions_are_refused(client: httpx.Client, body: object, words: list[str]) -> None:
    assert_problem(client.post("/sessions", json=body), 422, *words)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('{"cell": {"pose_convention": "ur", "note": NaN}}', "NaN"),
        ('{"cell": {"pose_convention": "ur", "note": 1e999}}', "1.8e308"),
        ('{"cell": {"pose_convention": "ur", "note": 1' + "0" * 5000 + "}}", "JSON"),
        ('{"cell": {"pose_convention": "ur", "note": "\\ud800"}}', "surrogate"),
        ('{"cell": {"pose_convention": "ur", "note": "a\\u0000b"}}', "NUL"),
        ('{"cell": ' + "[" * 50 + "]" * 50 + "}", "levels"),
        ("[" * 100_000, "levels"),
        ('{"cell": ', "JSON"),
        ("", "request"),
        (b'{"name": "\xff\xfe"}', "JSON"),
    ],
)
def test_json_that_cannot_be_stored_is_refused(client: httpx.Client, text: str | bytes, word: str) -> None:
    answer = client.post("/sessions", content=text, headers={"Content-Type": "application/json"})
    assert_problem(answer, 422, word)


def test_large_json_is_refused(client: httpx.Client) -> None:
    assert_problem(client.post("/sessions", json={"name": "x" * 300_000}), 413, "200000 bytes")


def test_lists_are_paged_newest_first_and_searched(client: httpx.Client) -> None:
    ids = [make_session(client, name=f"paged {number} %_") for number in range(5)]
    seen: list[str] = []
    cursor = None
    while True:
        parameters = {"limit": 2, "search": "PAGED"} | ({"cursor": cursor} if cursor else {})
        page = client.get("/sessions", params=parameters).json()
        assert len(page["items"]) <= 2
        seen += [item["id"] for item in page["items"]]
        cursor = page["next"]
        if cursor is None:
            break
    assert sorted(seen) == sorted(ids)
    assert len(client.get("/sessions", params={"search": "3 %_"}).json()["items"]) == 1
    item = client.get("/sessions", params={"search": "paged 4"}).json()["items"][0]
    assert set(item) == {
        "id",
        "name",
        "created",
        "updated",
        "cell",
        "capture_count",
        "verdicts",
        "stale",
        "cell_id",
        "archived",
    }
    assert item["capture_count"] == 0
    assert item["verdicts"] == {}


@pytest.mark.parametrize("cursor", ["x", "bnVsbA==", "WzEsMl0=", "é", "eyJhIjoxfQ=="])
def test_a_foreign_cursor_is_refused(client: httpx.Client, cursor: str) -> None:
    assert_problem(client.get("/sessions", params={"cursor": cursor}), 422, "cursor")


def test_changes_merge_and_count_revisions(client: httpx.Client) -> None:
    session = make_session(client)
    before = client.get(f"/sessions/{session}")
    changed = client.patch(
        f"/sessions/{session}",
        json={"name": "renamed", "cell": {"sphere_diameter_mm": 41.0, "scanner": None, "robot": {"brand": "ABB"}}},
        headers={"If-Match": before.headers["etag"]},
    )
    assert changed.status_code == 200
    assert changed.json()["cell"] == {
        "pose_convention": "fanuc",
        "sphere_diameter_mm": 41.0,
        "robot": {"brand": "ABB"},
    }
    assert changed.json()["revision"] == before.json()["revision"] + 1
    assert client.get(f"/sessions/{session}").headers["etag"] == changed.headers["etag"]


def test_what_the_server_gave_may_be_sent_back(client: httpx.Client) -> None:
    session = client.get(f"/sessions/{make_session(client)}").json()
    assert session.pop("captures") == []
    copy = {name: value for name, value in session.items() if name != "simulated"}
    assert client.post("/sessions", json={**copy, "revision": 77}).json()["revision"] == 1
    changed = client.patch(f"/sessions/{session['id']}", json={**session, "name": "again"}).json()
    assert changed == {**session, "name": "again", "captures": [], "revision": 2, "updated": changed["updated"]}


def test_a_change_against_an_older_revision_is_refused(client: httpx.Client) -> None:
    session = make_session(client)
    tag = client.get(f"/sessions/{session}").headers["etag"]
    assert client.patch(f"/sessions/{session}", json={"name": "mine"}).status_code == 200
    for answer in (
        client.patch(f"/sessions/{session}", json={"name": "yours"}, headers={"If-Match": tag}),
        client.delete(f"/sessions/{session}", headers={"If-Match": tag}),
    ):
        assert_problem(answer, 412, "If-Match")
    assert client.get(f"/sessions/{session}").json()["name"] == "mine"


def test_unusable_changes_are_refused(client: httpx.Client) -> None:
    session = make_session(client)
    assert_problem(client.patch(f"/sessions/{session}", json={"captures": []}), 422, "captures")
    assert_problem(client.patch(f"/sessions/{session}", json={"cell": None}), 422, "cell")
    assert_problem(client.patch(f"/sessions/{session}", json={"cell": {"pose_convention": "?"}}), 422, "fanuc")


def test_a_removed_session_is_gone(client: httpx.Client) -> None:
    session = make_session(client)
    assert client.delete(f"/sessions/{session}").status_code == 204
    for path in ("", "/captures", "/results", "/guide", "/events"):
        assert_problem(client.get(f"/sessions/{session}{path}"), 404, session)


def test_pose_lines_are_read_without_storing(client: httpx.Client) -> None:
    session = make_session(client)
    text = "X=-195.8 Y=1363.305 Z=524.812 W=-179.924 P=0.889 R=179.635\n\n1 2 3 4 5\nnan 1 2 3 4 5"
    items = client.post(f"/sessions/{session}/pose-lines", json={"text": text}).json()["items"]
    assert items[0]["numbers"] == [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]
    assert [row[3] for row in items[0]["matrix"]] == [-195.8, 1363.305, 524.812, 1.0]
    assert "problem" not in items[0]
    assert items[1]["line"] == 3
    assert "5" in items[1]["problem"]
    assert "problem" in items[2]
    answer = client.post(f"/sessions/{session}/pose-lines", json={"text": "1", "convention": "fanuk"})
    assert_problem(answer, 422, "fanuc")


def test_a_repeated_post_makes_one_session(client: httpx.Client) -> None:
    body = {"name": "once only", "cell": {"pose_convention": "abb"}}
    key = {"Idempotency-Key": "once-only-1"}
    first = client.post("/sessions", json=body, headers=key)
    again = client.post("/sessions", json=body, headers=key)
    assert (first.status_code, again.status_code) == (201, 201)
    assert first.json() == again.json()
    assert again.headers["idempotency-replayed"] == "true"
    assert len(client.get("/sessions", params={"search": "once only"}).json()["items"]) == 1
    other = client.post("/sessions", json={**body, "name": "other"}, headers=key)
    assert_problem(other, 409, "Idempotency-Key")


def test_a_described_cell_is_simulated_as_its_edges_say(client: httpx.Client) -> None:
    cell = {"scanners": {"gate": {"on": "base"}}, "axes": [{"name": "turn", "kind": "rotary"}]}
    made = client.post("/sessions", json={"simulated": {"scenario": "described", "seed": 3, "cell": cell}})
    assert made.status_code == 201, made.text
    path = f"/sessions/{made.json()['id']}"
    assert [axis["name"] for axis in made.json()["cell"]["axes"]] == ["turn"]
    for _ in range(2):
        assert client.post(f"{path}/sources/simulated/capture").json()["measured"]["verdict"] != "fail"
    assert client.get(f"{path}/guide").json()["steps"][2]["title"] == "Scanner in base"
    for wrong, word in (
        ({"axes": [{"name": "turn", "kind": "rotary", "on": "turn"}]}, "turn"),
        ({"scanners": {"gate": {"on": "base"}}, "spheres": [{"name": "ball", "on": "base"}]}, "gate"),
    ):
        refused = client.post("/sessions", json={"simulated": {"cell": wrong}})
        assert_problem(refused, 422, word)
