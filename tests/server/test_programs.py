"""What programs get beside the numbers: solves that are waited for, small answers, tags, honest refusals."""

import json
import socket
from typing import Any

import httpx
import pytest

from tests.server.live_server import assert_problem, make_session, simulated_session, upload, wait_for
from tests.server.test_captures import POSE, arc_csv

CELL = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0}
RECORD = {"id": "p01", "step": "tcp", "kind": "profile", "pose": POSE, "files": ["captures/p01.csv"]}


@pytest.mark.thorough
def test_a_solve_can_be_waited_for_and_all_stages_at_once(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14)
    done = client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60})
    assert (done.status_code, done.json()["status"]) == (200, "done")
    assert client.get(done.headers["Location"].removeprefix("/api/v1")).json() == done.json()
    every = client.post(
        f"/sessions/{session}/solve/all", params={"wait": 60}, headers={"Idempotency-Key": "night"}
    )
    assert (every.status_code, every.json()["stage"], every.json()["status"]) == (200, "all", "done")
    assert len(client.get(f"/sessions/{session}/results/tcp/history").json()["items"]) == 2
    again = client.post(
        f"/sessions/{session}/solve/all", params={"wait": 60}, headers={"Idempotency-Key": "night"}
    )
    assert again.json() == every.json()
    assert len(client.get(f"/sessions/{session}/results/tcp/history").json()["items"]) == 2


def test_all_stages_end_with_the_one_that_fails_in_its_own_words(client: httpx.Client) -> None:
    session = simulated_session(client, captures=2)
    failed = client.post(f"/sessions/{session}/solve/all", params={"wait": 60}).json()
    alone = client.post(f"/sessions/{session}/solve/tcp", params={"wait": 60}).json()
    assert failed["status"] == alone["status"] == "failed"
    assert failed["error"] == alone["error"]
    assert_problem(client.post(f"/sessions/{make_session(client)}/solve/all"), 422, "captures")


def test_a_cancel_of_all_stages_ends_the_one_that_runs(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14)
    job = client.post(f"/sessions/{session}/solve/all").json()["id"]
    assert client.post(f"/jobs/{job}/cancel").json()["status"] == "cancelled"
    assert wait_for(client, job)["status"] == "cancelled"
    children = client.get("/jobs", params={"session": session}).json()["items"]
    assert all(wait_for(client, child["id"])["status"] in ("cancelled", "done") for child in children)


def test_what_is_made_says_where_it_is_and_its_revision(client: httpx.Client) -> None:
    made = client.post("/sessions", json={"cell": CELL})
    session = made.json()["id"]
    taken = upload(client, session, RECORD, arc_csv(), headers={"Idempotency-Key": f"of {session}"})
    again = upload(client, session, RECORD, arc_csv(), headers={"Idempotency-Key": f"of {session}"})
    for answer in (made, taken, again):
        assert answer.status_code == 201, answer.text
        there = client.get(answer.headers["Location"].removeprefix("/api/v1"))
        assert there.json()["id"] == answer.json()["id"]
    capture = taken.headers["Location"].removeprefix("/api/v1")
    changed = client.patch(capture, json={"excluded": True}, headers={"If-Match": taken.headers["ETag"]})
    assert changed.status_code == 200, changed.text
    assert_problem(client.patch(capture, json={}, headers={"If-Match": taken.headers["ETag"]}), 412, "ETag")


def test_what_a_program_has_already_is_not_sent_again(client: httpx.Client) -> None:
    session = make_session(client)
    upload(client, session, RECORD, arc_csv())
    for path in ("", "/captures/p01", "/captures/p01/files/captures/p01.csv"):
        first = client.get(f"/sessions/{session}{path}")
        again = client.get(f"/sessions/{session}{path}", headers={"If-None-Match": first.headers["ETag"]})
        assert (again.status_code, again.content) == (304, b"")
        assert again.headers["ETag"] == first.headers["ETag"]
        other = client.get(f"/sessions/{session}{path}", headers={"If-None-Match": '"other"'})
        assert other.content == first.content
        head = client.head(f"/sessions/{session}{path}")
        assert (head.status_code, head.content) == (200, b"")
        assert head.headers["ETag"] == first.headers["ETag"]


def test_a_program_may_prefer_a_small_answer(client: httpx.Client) -> None:
    small = {"Prefer": "respond-async, return=minimal"}
    made = client.post("/sessions", json={"cell": CELL}, headers=small)
    assert made.headers["Preference-Applied"] == "return=minimal"
    session = made.json()["id"]
    taken = upload(client, session, RECORD, arc_csv(), headers=small)
    assert taken.json() == {"id": "p01", "measured": {"verdict": "pass", "reason": None, "to_do": None}}
    assert taken.headers["Location"].endswith("/captures/p01")
    refused = upload(client, session, RECORD, arc_csv(), headers=small)
    assert_problem(refused, 409, "p01")


@pytest.mark.parametrize(
    ("path", "body", "field", "likely"),
    [
        ("/sessions", {"cell": {**CELL, "sphere_diamter_mm": 40}}, "cell.sphere_diamter_mm", "sphere_diameter_mm"),
        ("/sessions", {"cel": {}, "cell": CELL}, "cel", "cell"),
        ("/sessions", {"cell": {**CELL, "robot": {"position_sigma": 1}}}, "cell.robot.position_sigma", "_mm"),
        ("{}", {"cel": {}}, "cel", "cell"),
        ("{}", {"cell": {"scanner": {"point_sigma": 1}}}, "cell.scanner.point_sigma", "point_sigma_mm"),
        ("{}/captures/p01", {"exclude": True}, "exclude", "excluded"),
    ],
)
def test_an_unknown_field_is_told_with_the_likely_one(
    client: httpx.Client, path: str, body: Any, field: str, likely: str
) -> None:
    session = make_session(client)
    upload(client, session, RECORD, arc_csv())
    method = "POST" if path == "/sessions" else "PATCH"
    answer = client.request(method, path.format(f"/sessions/{session}"), json=body)
    assert_problem(answer, 422, f"'{field}'", likely)
    wrong = upload(client, session, {**RECORD, "id": "p02", "files": ["2.csv"], "mont": "low"}, arc_csv())
    assert_problem(wrong, 422, "'mont'", "mount")


def test_what_a_session_says_of_itself_may_come_back(client: httpx.Client) -> None:
    session = make_session(client)
    whole = client.get(f"/sessions/{session}").json()
    del whole["captures"], whole["simulated"]
    assert client.patch(f"/sessions/{session}", json={**whole, "name": "again"}).status_code == 200
    assert client.post("/sessions", json=whole).status_code == 201


@pytest.mark.parametrize("name", ["tool0_from_laser", "base_from_turntable"])
def test_known_frames_that_are_not_rigid_are_refused_where_they_enter(client: httpx.Client, name: str) -> None:
    scaled = [[2, 0, 0, 1], [0, 2, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]
    cell = {**CELL, "known": {name: scaled}}
    assert_problem(client.post("/sessions", json={"cell": cell}), 422, f"cell.known.{name}")
    session = make_session(client)
    assert_problem(client.patch(f"/sessions/{session}", json={"cell": {"known": {name: scaled}}}), 422, name)
    turned = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    assert client.patch(f"/sessions/{session}", json={"cell": {"known": {name: turned}}}).status_code == 200


def test_a_body_of_another_type_is_refused_by_its_name(client: httpx.Client) -> None:
    session = make_session(client)
    text = client.post("/sessions", content="hello", headers={"Content-Type": "text/plain"})
    assert_problem(text, 415, "application/json", "text/plain")
    form = client.post(f"/sessions/{session}/captures", json=RECORD)
    assert_problem(form, 415, "multipart/form-data", "application/json")
    own = {"Content-Type": "application/merge-patch+json"}
    assert client.patch(f"/sessions/{session}", content=json.dumps({"name": "x"}), headers=own).status_code == 200


def test_a_method_that_an_address_does_not_take_names_all_that_it_takes(client: httpx.Client) -> None:
    answer = client.delete(f"/sessions/{make_session(client)}/captures")
    assert_problem(answer, 405, "Allow")
    assert answer.headers["Allow"] == "GET, HEAD, POST"
    assert client.put("/sessions").headers["Allow"] == "GET, HEAD, POST"


@pytest.mark.parametrize("chunked", [False, True])
def test_an_offer_of_another_protocol_costs_no_body(client: httpx.Client, chunked: bool) -> None:
    """Java's own client offers HTTP/2 in each request; two of them on one connection, head and body apart."""
    body = json.dumps({"name": "java", "cell": CELL}).encode()
    sent = f"{len(body):x}\r\n".encode() + body + b"\r\n0\r\n\r\n" if chunked else body
    length = "Transfer-Encoding: chunked" if chunked else f"Content-Length: {len(body)}"
    head = (
        f"POST /api/v1/sessions HTTP/1.1\r\nHost: {client.base_url.netloc.decode()}\r\n{length}\r\n"
        "Content-Type: application/json\r\nConnection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\n"
        "HTTP2-Settings: AAEAAEAAAAIAAAABAAMAAABkAAQBAAAAAAUAAEAA\r\n\r\n"
    ).encode()
    with socket.create_connection((client.base_url.host, client.base_url.port or 80), timeout=20) as connection:
        answers = connection.makefile("rb")
        for pieces in ((head, sent), (head + sent,)):
            for piece in pieces:
                connection.sendall(piece)
            assert answers.readline().startswith(b"HTTP/1.1 201")
            headers = dict(line.lower().split(b": ", 1) for line in iter(answers.readline, b"\r\n"))
            assert json.loads(answers.read(int(headers[b"content-length"])))["name"] == "java"
