"""Programs for controllers: slow, from outside; each dialect's dialogue, byte for byte, takes its captures."""

import io
import re
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose, to_pose
from calib_core.robots.programs.registry import PROGRAMS
from calib_core.simulation import simulate
from tests.server.live_rig import Rig, rig, until
from tests.server.live_server import assert_problem, make_session
from tests.server.test_live_devices import ABB_CELL, captures, devices
from tests.server.test_robot_port import Program, program, token

POSES = [c.pose or [] for c in simulate("tcp", 7).session.captures]
PLANNED = [{"id": f"p{k + 1:02d}", "pose": pose} for k, pose in enumerate(POSES)]


def files(client: httpx.Client, name: str, **more: Any) -> dict[str, str]:
    session = make_session(client, cell=ABB_CELL)
    body = {"host": "192.168.0.5", "port": 5870, "token": "scancell_x", "poses": PLANNED, **more}
    answer = client.post(f"/sessions/{session}/robot-programs/{name}", json=body)
    assert answer.status_code == 200, answer.text
    with zipfile.ZipFile(io.BytesIO(answer.content)) as zipped:
        return {entry: zipped.read(entry).decode("ascii") for entry in zipped.namelist()}


def test_every_dialect_is_listed(client: httpx.Client) -> None:
    items = client.get("/robot-programs").json()["items"]
    assert {item["name"] for item in items} == {"inform", "karel", "krl", "rapid", "urscript"}
    session = make_session(client, cell=ABB_CELL)
    url = f"/sessions/{session}/robot-programs"
    assert_problem(client.post(f"{url}/basic", json={"host": "h", "port": 1}), 422, "krl")
    assert_problem(client.post(f"{url}/krl", json={"host": "h", "port": 1}), 422, "planned set")
    assert_problem(client.post(f"{url}/krl", json={"host": "h", "port": 1, "speed_mm_s": 2000}), 422, "250")
    assert_problem(client.post(f"{url}/krl", json={"host": 'h";HALT', "port": 1}), 422)


@pytest.mark.parametrize("name", PROGRAMS.names())
def test_moves_are_slow_straight_and_from_outside(client: httpx.Client, name: str) -> None:
    made = files(client, name)
    convention = PROGRAMS.get(name).convention
    text = "\n".join(made.values())
    numbers = [list(map(float, found)) for found in READ[name](text)]
    poses = [parse_pose(convention, row) for row in numbers]
    true = [parse_pose("abb", pose) for pose in POSES]
    for k, wanted in enumerate(true):
        out, at = poses[2 * k], poses[2 * k + 1]
        assert np.abs(wanted.difference(at)).max() < 2e-3  # the digits that the controller is given
        away = out.translation_mm - at.translation_mm
        assert np.linalg.norm(away) == pytest.approx(150.0, abs=0.01)
        assert away @ -wanted.rotation[:, 2] == pytest.approx(150.0, abs=0.01)
    assert SLOW[name] in text
    assert max(len(line) for line in text.splitlines()) < 250


NUMBER = r"[-+]?\d+\.?\d*"


def rows(pattern: str, there: int = 2, of: int = 2) -> Callable[[str], list[list[str]]]:
    """Return what reads the numbers of each match, `there` of every `of`: the way back is the way there."""

    def read(text: str) -> list[list[str]]:
        found = re.findall(pattern, text, re.DOTALL)
        numbers = [re.findall(rf"(?<![A-Za-z\d.]){NUMBER}", match) for match in found]
        return [row for k, row in enumerate(numbers) if k % of < there]

    return read


READ: dict[str, Callable[[str], list[list[str]]]] = {
    "krl": rows(r"LIN \{([^}]*)\}", of=3),
    "rapid": rows(r"robtarget p\w+:=\[(\[[^\]]*\],\[[^\]]*\]),\[0,0"),
    "urscript": rows(r"movel\(p\[([^\]]*)\]", of=3),
    "karel": rows(r"\tX = ([^}]*)\}"),
    "inform": rows(r"P\d{5}=([^\r\n]*)"),
}
SLOW = {
    "krl": "$VEL.CP=0.050",
    "rapid": "speeddata vScan:=[50,20,50,20]",
    "urscript": "v=0.050",
    "karel": "50mm/sec FINE",
    "inform": "V=50.0",
}


def said_by_krl(pose: RigidTransform, name: str) -> bytes:
    numbers = dict(zip("XYZABC", to_pose("kuka", pose), strict=True))
    told = " ".join(f'{letter}="{value:.6f}"' for letter, value in numbers.items())
    return f'<Shot Capture="{name}"><Pose {told}></Pose></Shot>'.encode()


def said_by_rapid(pose: RigidTransform, name: str) -> bytes:
    x, y, z, *q = to_pose("abb", pose)
    return f"{name} {x:.3f} {y:.3f} {z:.3f} {' '.join(f'{v:.8f}' for v in q)}\r\n".encode()


def said_by_urscript(pose: RigidTransform, name: str) -> bytes:
    return f"{name} p[{', '.join(f'{v:.7g}' for v in to_pose('ur', pose))}]\n".encode()


def said_by_karel(pose: RigidTransform, name: str) -> bytes:
    return (name + "".join(f" {v: .3f}" for v in to_pose("fanuc", pose)) + "\r\n").encode()


DIALOGUES = {
    "krl": ("kuka", said_by_krl, b'<Hello Token="%s"/>', b'<End Done="1"/>', 'Ok="1"'),
    "rapid": ("abb", said_by_rapid, b"%s\r\n", b"done\r\n", "OK "),
    "urscript": ("ur", said_by_urscript, b"%s\n", b"done\n", "OK "),
    "karel": ("fanuc", said_by_karel, b"%s\r\n", b"done\r\n", "OK "),
}


@pytest.fixture
def cell(tmp_path: Path) -> Any:
    with rig(tmp_path / "exposures", every_s=0.03, travel_s=0.1) as made:
        yield made


def test_the_dialogue_of_each_dialect_takes_fourteen_captures(client: httpx.Client, cell: Rig) -> None:
    """One cell, and at each stop the four dialects speak at once, each on the port of its own session."""
    sessions: dict[str, str] = {}
    with ExitStack() as stack, ThreadPoolExecutor(len(DIALOGUES)) as together:
        robots = {}
        for name, (convention, _, hello, _, good) in DIALOGUES.items():
            own = {**ABB_CELL, "pose_convention": convention}
            session = sessions[name] = make_session(client, name=f"program in {name}", cell=own)
            scanner = {"source": "frame-folder", "settings": {"folder": str(cell.folder)}}
            assert client.put(f"/sessions/{session}/devices/scanner", json=scanner).status_code == 200
            port = client.put(f"/sessions/{session}/robot-port", json={}).json()["port"]
            robots[name] = stack.enter_context(program(port))
            assert good in robots[name].say(hello % token(client).encode())
        until(lambda: all(devices(client, s)["scanner"]["status"] == "live" for s in sessions.values()))
        stops = (cell.good * 2)[:14]
        for count, number in enumerate(stops, start=1):
            cell.go(number)
            until(lambda: not cell.cell.at(cell.now()).moving)
            reported = RigidTransform(cell.cell.shots[number].reported, "base", "tool0")
            said = [DIALOGUES[name][1](reported, f"p{count:02d}") for name in robots]
            answers = list(together.map(Program.say, robots.values(), said))
            assert all(DIALOGUES[n][4] in answer for n, answer in zip(robots, answers, strict=True)), answers
        for name, robot in robots.items():
            assert "done 14 captures" in robot.say(DIALOGUES[name][3])
    for name, session in sessions.items():
        client.delete(f"/sessions/{session}/robot-port")
        client.delete(f"/sessions/{session}/devices/scanner")
        found = captures(client, session)
        assert len(found) == len(stops)
        for capture, number in zip(found, stops, strict=True):
            wanted = RigidTransform(cell.cell.shots[number].reported, "base", "tool0")
            told = parse_pose(DIALOGUES[name][0], capture["pose"])
            assert np.abs(wanted.difference(told)).max() < 2e-3
