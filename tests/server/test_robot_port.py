"""The port for robot programs: closed until asked for, a token first, the rights and the log of REST."""

import socket
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest

from calib_core.simulation.profile_cell import pose_numbers
from tests.server.live_rig import rig, until
from tests.server.live_server import assert_problem, make_session
from tests.server.test_live_devices import ABB_CELL, captures, devices


class Program:
    """A robot's program: sends a line and waits for the answer."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=20)

    def say(self, text: str | bytes) -> str:
        received = b""
        with suppress(ConnectionError):  # it was cut off
            self._socket.sendall(text if isinstance(text, bytes) else f"{text}\r\n".encode())
            while not received.endswith(b"\n"):
                more = self._socket.recv(200)
                if not more:
                    break
                received += more
        return received.decode("ascii").strip()

    def close(self) -> None:
        self._socket.close()


@contextmanager
def program(port: int) -> Generator[Program]:
    made = Program(port)
    try:
        yield made
    finally:
        made.close()


def token(client: httpx.Client, role: str = "capture") -> str:
    return client.post("/tokens", json={"name": f"robot {role}", "role": role}).json()["token"]


@pytest.fixture
def port(client: httpx.Client) -> Any:
    session = make_session(client, cell=ABB_CELL)
    answer = client.put(f"/sessions/{session}/robot-port", json={})
    assert answer.status_code == 200, answer.text
    yield session, answer.json()["port"]
    client.delete(f"/sessions/{session}/robot-port")


def test_the_port_is_closed_until_it_is_asked_for(client: httpx.Client) -> None:
    session = make_session(client)
    assert client.get(f"/sessions/{session}/robot-port").json()["open"] is False
    number = client.put(f"/sessions/{session}/robot-port", json={}).json()["port"]
    with program(number):
        pass
    assert client.delete(f"/sessions/{session}/robot-port").status_code == 204
    with pytest.raises(ConnectionRefusedError):
        Program(number)
    wrong = {"host": "192.0.2.1", "port": 1}
    assert_problem(client.put(f"/sessions/{session}/robot-port", json=wrong), 422, "serve on")
    assert_problem(client.put(f"/sessions/{session}/robot-port", json={"allowed": ["no"]}), 422)
    for host in ("\u00d2% \u0081c\u00ee", "x" * 64, "a..b", ""):
        assert_problem(client.put(f"/sessions/{session}/robot-port", json={"host": host}), 422)
    assert_problem(client.put("/sessions/none/robot-port", json={}), 404)


def test_without_a_good_token_nothing_is_said(client: httpx.Client, port: Any) -> None:
    _, number = port
    for first in ("p01 1 2 3 1 0 0 0", "scancell_000000000000_" + "x" * 43, token(client, "read"), "<a/>"):
        with program(number) as robot:
            assert robot.say(first).startswith(("NO no good token", '<Answer Ok="0"'))
            assert robot.say("p01 1 2 3 1 0 0 0") == ""


def test_an_address_that_is_not_allowed_is_cut_off(client: httpx.Client, port: Any) -> None:
    session, _ = port
    answer = client.put(f"/sessions/{session}/robot-port", json={"allowed": ["192.0.2.0/24"]})
    with program(answer.json()["port"]) as robot:
        assert robot.say(token(client)) == ""


def test_what_a_program_gets_wrong_is_answered_in_short(client: httpx.Client, port: Any) -> None:
    session, number = port
    with program(number) as robot:
        assert robot.say(token(client)) == "OK hello robot capture"
        assert robot.say("p01 1 2 3 1 0 0 0").startswith("NO none, connect")
        assert robot.say("p01 1 2 3").startswith("NO ")
        assert robot.say("/etc 1 2 3").startswith("NO ")
        assert robot.say(b'<Scancell Capture="p01"><Pose X="1"/></Scancell>').startswith('<Answer Ok="0"')
        assert robot.say("done") == "OK done 0 captures"
        assert robot.say("x" * 3000).startswith("NO ")
        assert robot.say("done") == ""
    told = client.get(f"/sessions/{session}/robot-port").json()
    assert told["lines"][0]["said"] == "OK hello robot capture"
    assert "scancell_" not in str(told)


def test_a_revoked_token_ends_the_dialogue(client: httpx.Client, port: Any) -> None:
    _, number = port
    made = client.post("/tokens", json={"name": "gone", "role": "capture"}).json()
    with program(number) as robot:
        assert robot.say(made["token"]) == "OK hello gone"
        assert client.delete(f"/tokens/{made['id']}").status_code == 204
        assert robot.say("done") == ""


@pytest.mark.thorough
def test_a_program_takes_captures_over_tcp_and_http(client: httpx.Client, port: Any, tmp_path: Path) -> None:
    session, number = port
    with rig(tmp_path / "exposures") as made, program(number) as robot:
        scanner = {"source": "frame-folder", "settings": {"folder": str(made.folder)}}
        assert client.put(f"/sessions/{session}/devices/scanner", json=scanner).status_code == 200
        until(lambda: devices(client, session)["scanner"]["status"] == "live")

        def stand(number: int) -> str:
            made.go(number)
            until(lambda: not made.cell.at(made.now()).moving)
            return " ".join(map(str, pose_numbers(made.cell.shots[number].reported)))

        assert robot.say(token(client)) == "OK hello robot capture"
        first, second, third = made.good[:3]
        line = f"p01 {stand(first)}"
        answer = robot.say(line)
        assert answer.startswith("OK p01 good 0.")
        assert robot.say(line) == answer  # the answer got lost: nothing is stored twice
        assert robot.say(f"p01 {stand(second)}").startswith("NO p01 is stored already")
        url = f"/sessions/{session}/robot"
        assert client.post(url, content=f"p02 {stand(second)}").text.startswith("OK p02 good")
        x, y, z, *q = stand(third).split()
        element = f'<Scancell Capture="p03"><Pose X="{x}" Y="{y}" Z="{z}" Q="{" ".join(q)}"/></Scancell>'
        assert 'Ok="1" Capture="p03"' in robot.say(element.encode())
        weak = next(k for k in range(len(made.cell.shots)) if made.offset(k) < 0.28)
        assert robot.say(f"p04 {stand(weak)}").startswith("NO stripe through the middle of the sphere, move ")
        assert robot.say("done") == "OK done 3 captures"
        client.delete(f"/sessions/{session}/devices/scanner")
    found = captures(client, session)
    assert [c["id"] for c in found] == ["p01", "p02", "p03"]
    assert found[0]["pose"] == pose_numbers(made.cell.shots[first].reported)
    assert "robot program at 127.0.0.1" in found[0]["source"]
    log = client.get("/audit", params={"limit": 20}).json()["items"]
    assert any(row["method"] == "TCP" and row["who"] == "robot capture" for row in log)
