"""Altered files and records of every kind end in no 500; thousands of them: `scancell bench hostile`."""

import socket

import httpx
import pytest
from bench_hostile import KINDS, attack

from tests.server.live_server import make_session, upload
from tests.server.test_captures import record


@pytest.mark.thorough
def test_altered_files_and_records_end_in_no_500(client: httpx.Client) -> None:
    trials = attack(client, 20 * len(KINDS), seed=1)
    assert not trials.faults, trials.faults
    assert all(trials.kinds[kind] == 20 for kind in KINDS)
    assert trials.statuses[422] > 20  # else nothing was altered
    assert trials.statuses[201] > 5


def test_a_capture_whose_figures_are_beyond_all_scanners_is_kept(client: httpx.Client) -> None:
    session = make_session(client)
    cloud = b"\n".join(b"%d.3e34 %d.7e33 -%d.9e34" % (n, 2 * n, 3 * n) for n in range(100, 200))
    answer = upload(client, session, {**record(), "kind": "cloud", "files": ["a.xyz"]}, cloud)
    assert answer.status_code == 201, answer.text
    assert answer.json()["measured"]["verdict"] == "fail"
    assert client.get(f"/sessions/{session}/guide").status_code == 200


def test_a_capture_of_figures_that_stand_for_nothing_is_kept_and_shows_nothing(client: httpx.Client) -> None:
    session = make_session(client)
    cloud = b"\n".join(b"1e308 %d -1e308" % number for number in range(100))
    answer = upload(client, session, {**record(), "kind": "cloud", "files": ["a.xyz"]}, cloud)
    assert answer.status_code == 201, answer.text
    (finding,) = answer.json()["measured"]["findings"]
    assert (finding["code"], finding["severity"]) == ("capture-shows-nothing", "error")
    assert "100 blanks" in finding["text"]


def test_a_refusal_in_the_middle_of_a_body_reaches_who_is_still_sending(client: httpx.Client) -> None:
    session = make_session(client)
    host, port = client.base_url.host, client.base_url.port or 80
    body = b"not a capture\n" + b"x" * 1_500_000
    with socket.create_connection((host, port), timeout=30) as connection:
        head = f"POST /api/v1/sessions/{session}/captures/batch HTTP/1.1\r\nHost: {host}:{port}\r\n"
        connection.sendall(f"{head}Content-Length: {len(body)}\r\n\r\n".encode())
        connection.sendall(body)
        assert connection.recv(12) == b"HTTP/1.1 200"
