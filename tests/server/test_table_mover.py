"""A table that is turned: off unless armed, within limits, watched, stopped."""

import threading
import time
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from server.simulated_cell.modbus_server import ModbusServer
from tests.server.live_rig import until
from tests.server.live_server import assert_problem, make_session
from tests.server.test_live_devices import ABB_CELL, devices


class Table:
    """A table that turns at a rate; `stuck`, it turns no further, `wild`, it turns the other way."""

    def __init__(self, rate_deg_s: float = 200.0) -> None:
        self._rate = rate_deg_s
        self._at, self._target, self._since_s = 0.0, 0.0, time.monotonic()
        self.wild = False
        self.stuck_at: float | None = None
        self.told_deg: float | None = None  # what its encoder repeats
        self.stops = 0
        self.server = ModbusServer(self.told, turn=self.turn)

    def angle(self) -> tuple[float, bool]:
        way = self._rate * (time.monotonic() - self._since_s)
        left = self._target - self._at
        at = self._at + float(np.sign(left)) * min(way, abs(left))
        if self.stuck_at is not None:
            at = min(at, self.stuck_at)
        return at, way < abs(left) and self.stuck_at is None

    def told(self) -> tuple[float, bool]:
        return self.angle() if self.told_deg is None else (self.told_deg, False)

    def turn(self, target: float | None) -> None:
        self._at, self._since_s = self.angle()[0], time.monotonic()
        if target is None:
            self.stops += 1
        self._target = self._at if target is None else -target if self.wild else target


@pytest.fixture
def table() -> Iterator[Table]:
    made = Table()
    yield made
    made.server.stop()


@pytest.fixture
def session(client: httpx.Client, table: Table) -> Iterator[str]:
    made = make_session(client, name="armed table", cell=ABB_CELL)
    settings = {"host": "127.0.0.1", "port": table.server.port, "address": 100, "moving": 10, "interval_s": 0.02}
    client.put(f"/sessions/{made}/devices/table", json={"source": "modbus", "settings": settings})
    until(lambda: devices(client, made)["table"]["status"] == "live")
    yield made
    client.delete(f"/sessions/{made}/table-mover")
    client.delete(f"/sessions/{made}/devices/table")


def arm(client: httpx.Client, session: str, table: Table, **more: Any) -> httpx.Response:
    settings = {"host": "127.0.0.1", "port": table.server.port, "target": 200, "start": 20, "stop": 21}
    body = {"mover": "modbus-table", "settings": settings, "low_deg": -10, "high_deg": 120, **more}
    return client.put(f"/sessions/{session}/table-mover", json=body)


def go(client: httpx.Client, session: str, angle: float) -> httpx.Response:
    return client.post(f"/sessions/{session}/table-mover/go", json={"table_deg": angle})


def test_it_is_off_until_it_is_armed_and_turns_within_its_limits(
    client: httpx.Client, session: str, table: Table
) -> None:
    assert [m["name"] for m in client.get("/movers").json()["items"]] == ["modbus-table"]
    assert client.get(f"/sessions/{session}/table-mover").json()["armed"] is False
    assert_problem(go(client, session, 45.0), 409, "armed")
    assert_problem(client.post(f"/sessions/{session}/table-mover/stop"), 409, "armed")
    told = arm(client, session, table).json()
    assert (told["armed"], told["low_deg"], told["high_deg"]) == (True, -10, 120)
    assert go(client, session, 45.0).json()["table_deg"] == pytest.approx(45.0, abs=0.01)
    assert table.angle() == (45.0, False)
    for outside in (-10.5, 121.0):
        assert_problem(go(client, session, outside), 422, "-10")
    assert table.angle() == (45.0, False)
    assert client.delete(f"/sessions/{session}/table-mover").status_code == 204
    assert table.stops >= 1
    assert_problem(go(client, session, 50.0), 409, "armed")


def test_an_armed_table_is_let_go_when_its_time_is_over_without_being_asked(
    client: httpx.Client, session: str, table: Table
) -> None:
    assert arm(client, session, table, minutes=0.005).json()["armed"] is True
    until(lambda: table.stops == 1)  # as disarming tells it
    assert client.get(f"/sessions/{session}/table-mover").json()["armed"] is False


def test_a_stop_ends_a_turn(client: httpx.Client, session: str, table: Table) -> None:
    arm(client, session, table)
    table._rate = 20.0
    answers: list[httpx.Response] = []
    turning = threading.Thread(target=lambda: answers.append(go(client, session, 100.0)))
    turning.start()
    until(lambda: table.angle()[1])
    assert_problem(go(client, session, 10.0), 409, "turns")
    assert client.post(f"/sessions/{session}/table-mover/stop").status_code == 204
    turning.join(10)
    assert_problem(answers[0], 409, "stop")
    at, moving = table.angle()
    assert 0 < at < 100
    assert not moving
    assert client.get(f"/sessions/{session}/table-mover").json()["armed"] is True


def test_a_sweep_while_the_table_is_turned_is_refused_though_its_angle_stands(
    client: httpx.Client, session: str, table: Table
) -> None:
    arm(client, session, table)
    table.told_deg = 0.0
    turning = threading.Thread(target=lambda: go(client, session, 100.0))
    turning.start()
    until(lambda: client.get(f"/sessions/{session}/table-mover").json()["target_deg"] == 100.0)
    swept = client.post(f"/sessions/{session}/live/sweep", json={"seconds": 0.5})
    assert_problem(swept, 409, "one that turns", "between sweeps")
    turning.join(10)
    swept = client.post(f"/sessions/{session}/live/sweep", json={"seconds": 0.5})
    assert "one that turns" not in swept.text  # the mover has given up, and stopped it


def test_what_goes_wrong_is_stopped(client: httpx.Client, session: str, table: Table) -> None:
    arm(client, session, table)
    table.wild = True
    assert_problem(go(client, session, 100.0), 409, "limits")
    assert table.stops == 1
    assert not table.angle()[1]
    assert table.angle()[0] > -60  # stopped on its way to -100


def test_without_the_tables_angle_nothing_is_turned(client: httpx.Client, session: str, table: Table) -> None:
    arm(client, session, table)
    table._rate = 20.0
    answers: list[httpx.Response] = []
    turning = threading.Thread(target=lambda: answers.append(go(client, session, 100.0)))
    turning.start()
    until(lambda: table.angle()[1])
    client.put(
        f"/sessions/{session}/devices/table",
        json={"source": "modbus", "settings": {"host": "127.0.0.1", "port": 9, "address": 1}},
    )
    turning.join(10)
    assert_problem(answers[0], 409, "angle")
    assert table.stops >= 1
    assert not table.angle()[1]
    assert_problem(go(client, session, 10.0), 409, "angle")


def test_what_cannot_be_armed_says_so(client: httpx.Client, session: str, table: Table) -> None:
    assert_problem(arm(client, session, table, mover="crane"), 422, "modbus-table")
    assert_problem(arm(client, session, table, low_deg=10, high_deg=10), 422, "low_deg")
    assert_problem(arm(client, session, table, settings={"host": "127.0.0.1"}), 422)
    nobody = {"host": "127.0.0.1", "port": 9, "target": 1, "start": 1, "stop": 2}
    assert_problem(arm(client, session, table, settings=nobody), 409, "cable")
    other = make_session(client)
    assert_problem(arm(client, other, table), 409, "connected")
    arm(client, session, table, minutes=0.001)
    until(lambda: not client.get(f"/sessions/{session}/table-mover").json()["armed"])
    assert_problem(go(client, session, 20.0), 409, "armed")


def test_a_table_that_is_gone_says_that_it_could_not_be_stopped(
    client: httpx.Client, session: str, table: Table
) -> None:
    arm(client, session, table)
    table.server.stop()
    assert_problem(client.post(f"/sessions/{session}/table-mover/stop"), 409, "at the machine")
    assert client.delete(f"/sessions/{session}/table-mover").status_code == 204
