"""Live devices: kept with the cell, connected for a session, told of when they go, and captured at standstill."""

import json
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose
from tests.server.live_rig import Rig, rig, until
from tests.server.live_server import assert_problem, make_session

ABB_CELL: dict[str, Any] = {
    "pose_convention": "abb",
    "sphere_diameter_mm": 40.0,
    "scanner": {"kind": "profile", "point_sigma_mm": 0.02},
    "robot": {"position_sigma_mm": 0.05, "orientation_sigma_deg": 0.0114592},
}


def devices(client: httpx.Client, session: str) -> dict[str, Any]:
    return {d["name"]: d for d in client.get(f"/sessions/{session}/devices").json()["items"]}


def status(client: httpx.Client, session: str, name: str) -> str:
    return devices(client, session)[name]["status"]


def captures(client: httpx.Client, session: str) -> list[Any]:
    return client.get(f"/sessions/{session}/captures").json()["items"]


def both_live(client: httpx.Client, session: str) -> None:
    until(
        lambda: [d["status"] for d in devices(client, session).values()] == ["live", "live"],
        lambda: devices(client, session),
    )


def test_settings_are_kept_with_the_cell_and_secrets_apart(client: httpx.Client) -> None:
    session = make_session(client, name="kept devices")
    body = {"source": "pose-lines", "settings": {"host": "127.0.0.1", "port": 1}, "connected": False}
    answer = client.put(f"/sessions/{session}/devices/robot", json=body)
    assert answer.status_code == 200, answer.text
    other = make_session(client, name="kept devices")
    found = devices(client, other)["robot"]
    assert found["status"] == "off"
    assert found["settings"] == {"host": "127.0.0.1", "port": 1}
    assert client.delete(f"/sessions/{other}/devices/robot").status_code == 204
    assert devices(client, session) == {}
    assert_problem(client.delete(f"/sessions/{session}/devices/robot"), 404, "device")


def test_what_is_no_live_source_or_has_wrong_settings_is_refused(client: httpx.Client) -> None:
    session = make_session(client)
    put = lambda name, **body: client.put(f"/sessions/{session}/devices/{name}", json=body)  # noqa: E731
    assert_problem(put("a", source="nothing"), 422, "pose-lines")
    assert_problem(put("a", source="simulated"), 422, "pose-lines", "got 'simulated'")
    assert_problem(put("a", source="pose-lines", settings={"host": "h", "port": 70000}), 422, "65535")
    assert_problem(put("a", source="pose-lines", settings={"host": "h", "port": 7, "axe": 1}), 422)
    assert_problem(put("a b", source="pose-lines", settings={}), 422)
    assert_problem(client.post(f"/sessions/{session}/live/capture", json={}), 409, "connected")
    assert_problem(client.put(f"/sessions/{session}/live", json={"step": "no"}), 422)
    assert {"a", "a b"}.isdisjoint(devices(client, session))  # others may have theirs on the shared server


def test_a_device_that_cannot_be_reached_says_so(client: httpx.Client, tmp_path: Path) -> None:
    session = make_session(client)
    body = {"source": "pose-lines", "settings": {"host": "127.0.0.1", "port": 9}}
    assert client.put(f"/sessions/{session}/devices/robot", json=body).status_code == 200
    until(lambda: status(client, session, "robot") == "lost")
    assert "Cannot be reached" in devices(client, session)["robot"]["problem"]
    body = {"source": "frame-folder", "settings": {"folder": str(tmp_path / "none")}}
    assert client.put(f"/sessions/{session}/devices/camera", json=body).status_code == 200
    until(lambda: "need a folder" in devices(client, session)["camera"]["problem"])
    assert client.delete(f"/sessions/{session}").status_code == 204


def true_difference(made: Rig, capture: dict[str, Any]) -> tuple[str, float, float]:
    """Return the shot whose pose a capture has, how far the pose is off, and how far the sphere's centre is."""
    pose = parse_pose("abb", capture["pose"])
    shots = {s.name: RigidTransform(s.reported, "base", "tool0") for s in made.cell.shots}
    name, off = min(((n, float(np.abs(pose.difference(p)).max())) for n, p in shots.items()), key=lambda x: x[1])
    shot = next(s for s in made.cell.shots if s.name == name)
    seen = np.array(capture["measured"]["center_mm"])
    return name, off, float(np.abs(seen - shot.sphere_center_in_laser_mm[[0, 2]]).max())


@pytest.fixture
def live(client: httpx.Client, tmp_path: Path) -> Any:
    with rig(tmp_path / "exposures") as made:
        session = make_session(client, name=f"live {tmp_path.name}", cell=ABB_CELL)
        made.connect(client, session)
        both_live(client, session)
        yield made, session
        client.delete(f"/sessions/{session}/devices/robot")
        client.delete(f"/sessions/{session}/devices/scanner")


def test_one_capture_is_taken_at_each_standstill_and_none_on_the_way(client: httpx.Client, live: Any) -> None:
    made, session = live
    client.put(f"/sessions/{session}/live", json={"automatic": True, "step": "tcp"})
    stops = made.good[:4]
    for count, number in enumerate(stops, start=1):
        made.go(number)
        until(
            lambda n=count: len(captures(client, session)) >= n,
            lambda: client.get(f"/sessions/{session}/devices").text,
        )
    found = captures(client, session)
    assert [c["id"] for c in found] == ["p01", "p02", "p03", "p04"]
    differences = [true_difference(made, capture) for capture in found]
    assert [name for name, _, _ in differences] == [made.cell.shots[k].name for k in stops]
    assert max(off for _, off, _ in differences) < 1e-5  # each with its own pose, which was told at rest
    assert max(off for _, _, off in differences) < 0.1
    assert all("stood still: 3 exposures" in c["source"] and c["moving"] is False for c in found)
    stored = client.get(f"/sessions/{session}/captures/p01/files/p01.csv").content
    assert stored.startswith(b"x_mm,z_mm")


@pytest.mark.thorough
def test_a_capture_is_taken_when_asked_for_and_refused_on_the_move(client: httpx.Client, live: Any) -> None:
    made, session = live
    made.go(made.good[0])
    until(lambda: not made.cell.at(time.monotonic()).moving)
    taken = client.post(f"/sessions/{session}/live/capture", json={"id": "first", "why": "one more"})
    assert taken.status_code == 201, taken.text
    assert captures(client, session)[0]["added_because"]["why"] == "one more"
    assert taken.json()["id"] == "first"
    assert taken.json()["verdict"] == "pass"
    when = datetime.fromisoformat(captures(client, session)[0]["taken"])
    assert timedelta() <= datetime.now(UTC) - when < timedelta(minutes=5)
    wrong = captures(client, session)[0]["pose"]
    made.go(made.good[2])
    until(lambda: not made.cell.at(time.monotonic()).moving)
    assert_problem(
        client.post(f"/sessions/{session}/live/capture", json={"id": "second", "pose": wrong}), 409, "apart"
    )
    assert [c["id"] for c in captures(client, session)] == ["first"]


def test_the_stream_tells_of_profile_arc_and_pose(client: httpx.Client, live: Any) -> None:
    _, session = live
    with client.stream("GET", f"/sessions/{session}/live/events") as stream:
        lines = (line for line in stream.iter_lines() if line.startswith("data:"))
        told: Any = next(
            data for line in lines if (data := json.loads(line[5:])).get("exposure") and data["robot"]
        )
    assert len(told["exposure"]["points"]) > 100
    assert 0.2 < told["exposure"]["zone"] < 1.0
    assert np.shape(told["robot"]["base_from_tool0"]) == (4, 4)
    assert {d["name"] for d in told["devices"]} == {"robot", "scanner"}


@pytest.mark.thorough
def test_a_robot_that_goes_away_is_told_of_and_resumed(client: httpx.Client, live: Any) -> None:
    made, session = live
    made.robot.refuses.set()
    until(lambda: status(client, session, "robot") == "lost")
    assert_problem(client.post(f"/sessions/{session}/live/capture", json={}), 409, "stand")
    made.robot.refuses.clear()
    both_live(client, session)
    made.robot.pauses.set()
    until(lambda: status(client, session, "robot") == "silent")
    made.robot.pauses.clear()
    both_live(client, session)
    made.robot.line = lambda: b"nan nan nan 1 0 0 0\r\n"
    until(lambda: status(client, session, "robot") == "nonsense")
    made.robot.line = made.pose_line
    both_live(client, session)
    assert captures(client, session) == []


@pytest.mark.thorough
def test_a_stopped_scanner_takes_no_captures(client: httpx.Client, live: Any) -> None:
    made, session = live
    until(lambda: devices(client, session)["scanner"]["readings"] > 10)  # fewer are no stream, which could end
    made.blind.set()
    until(lambda: status(client, session, "scanner") == "silent")
    assert_problem(client.post(f"/sessions/{session}/live/capture", json={}), 409, "stand")
    made.blind.clear()
    both_live(client, session)
