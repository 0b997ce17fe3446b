"""The simulated cell calibrated through live sources: captures at standstill, truth within its uncertainty."""

import time
from typing import Any

import httpx
import numpy as np
import pytest
from scipy.stats import chi2

from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose
from server.simulated_cell.devices import SimulatedDevices
from tests.server.live_rig import until
from tests.server.live_server import make_session, wait_for
from tests.server.test_live_devices import captures, devices

SEED = 3


@pytest.fixture
def cell() -> Any:
    made = SimulatedDevices("turntable", SEED, rate_hz=40.0, travel_s=0.3)
    yield made
    made.stop()


def unlikely(found: Any, truth: Any, covariance: Any, frames: tuple[str, str], directions: int) -> float:
    """Return in which share of right answers the truth would be as far, in what is determined."""
    off = RigidTransform(np.array(found), *frames).difference(RigidTransform(np.array(truth), *frames))
    values, vectors = np.linalg.eigh(np.array(covariance))
    parts = (vectors.T @ off)[-directions:] if directions < 6 else vectors.T @ off
    return float(chi2.sf(np.sum(parts**2 / values[-directions:]), directions))


def test_tool_and_table_are_calibrated_through_live_sources(client: httpx.Client, cell: SimulatedDevices) -> None:
    record = cell.simulated.session.to_json()
    session = make_session(client, name="live calibration", cell=record["cell"])
    for name, body in cell.sources().items():
        answer = client.put(f"/sessions/{session}/devices/{name}", json=dict(body))
        assert answer.status_code == 200, answer.text
    until(lambda: {d["status"] for d in devices(client, session).values()} == {"live"})
    radius = cell.cell.world.sphere_radius_mm
    offsets = [abs(shot.sphere_center_in_laser_mm[1]) / radius for shot in cell.cell.shots]
    good = [k for k, offset in enumerate(offsets) if 0.36 < offset < 0.78]
    tcp = [k for k in good if cell.cell.shots[k].table is None]
    table = [k for k in good if cell.cell.shots[k].table is not None][::2]
    expected = []
    for number in (*tcp, *table):
        shot = cell.cell.shots[number]
        step = "turntable" if shot.table else "tcp"
        cell.go(number)
        until(lambda: not cell.is_moving)
        mount = shot.table.reported_mount if shot.table else None
        client.put(f"/sessions/{session}/live", json={"automatic": True, "step": step, "mount": mount})
        expected.append(shot)
        until(
            lambda: len(captures(client, session)) >= len(expected),
            lambda: client.get(f"/sessions/{session}/devices").text,
        )
        client.put(f"/sessions/{session}/live", json={"automatic": False})
    found = captures(client, session)
    assert len(found) == len(expected)
    for capture, shot in zip(found, expected, strict=True):
        wanted = RigidTransform(shot.reported, "base", "tool0")
        assert np.abs(wanted.difference(parse_pose("abb", capture["pose"]))).max() < 1e-5
        assert capture["moving"] is False
        seen = np.array(capture["measured"]["center_mm"])
        assert np.abs(seen - shot.sphere_center_in_laser_mm[[0, 2]]).max() < 0.1
        if shot.table:
            assert capture["table_deg"] == pytest.approx(shot.table.reported_angle, abs=6e-4)
            assert capture["mount"] == shot.table.reported_mount
    job = client.post(f"/sessions/{session}/solve/all").json()["id"]
    assert wait_for(client, job, 120)["status"] == "done"
    results = client.get(f"/sessions/{session}/results").json()
    truth = cell.simulated.truth
    tool = results["tcp"]
    assert unlikely(
        tool["tool0_from_laser"], truth["tool0_from_laser"], tool["covariance"], ("tool0", "laser"), 6
    ) > 0.001  # fmt: skip
    direction = np.array(results["turntable"]["axis_direction_in_base"])
    assert np.arccos(min(direction @ np.array(truth["axis_direction_in_base"]), 1.0)) < 2e-3
    for name in cell.sources():
        client.delete(f"/sessions/{session}/devices/{name}")


def test_captures_on_the_move_are_none(client: httpx.Client, cell: SimulatedDevices) -> None:
    session = make_session(client, name="live moves", cell=cell.simulated.session.to_json()["cell"])
    for name, body in cell.sources().items():
        client.put(f"/sessions/{session}/devices/{name}", json=dict(body))
    until(lambda: {d["status"] for d in devices(client, session).values()} == {"live"})
    client.put(f"/sessions/{session}/live", json={"automatic": True})
    taken = len(captures(client, session))
    end_s = time.monotonic() + 3.0
    number = 0
    while time.monotonic() < end_s:  # on its way all the time
        number += 1
        cell.go(number % 4)
        time.sleep(0.15)
    assert len(captures(client, session)) <= taken + 1  # the one at the start, where it stood
    for name in cell.sources():
        client.delete(f"/sessions/{session}/devices/{name}")


def test_the_clocks_offset_is_measured_over_the_protocols(client: httpx.Client) -> None:
    """The scanner's clock tells 37 ms more than the robot's; both come with the readings."""
    made = SimulatedDevices("tcp", SEED, rate_hz=30.0, travel_s=0.6, scanner_clock_s=0.037)
    try:
        session = make_session(client, name="live clocks", cell=made.simulated.session.to_json()["cell"])
        for name, body in made.sources().items():
            client.put(f"/sessions/{session}/devices/{name}", json=dict(body))
        until(lambda: {d["status"] for d in devices(client, session).values()} >= {"live"})
        made.shake(mm=10.0, period_s=1.2)
        time.sleep(7.0)
        answer = client.post(f"/sessions/{session}/live/clock-offset")
        assert answer.status_code == 200, answer.text
        told = answer.json()
        assert abs(told["offset_s"] - 0.037) < 0.001
        assert told["sigma_s"] < 0.001
        assert told["clocks"] == "scanner: device, robot: device"
        for name in made.sources():
            client.delete(f"/sessions/{session}/devices/{name}")
    finally:
        made.stop()
