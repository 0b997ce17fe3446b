"""Programs for controllers: slow, from outside; each dialect's text, run by an interpreter, takes its captures."""

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier, BrokenBarrierError
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
from tests.server.robot_interpreters import INTERPRETERS, Controller
from tests.server.test_live_devices import ABB_CELL, captures, devices
from tests.server.test_robot_port import token

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
    assert {item["name"] for item in items} == {"krl", "rapid", "urscript"}
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
}
SLOW = {
    "krl": "$VEL.CP=0.050",
    "rapid": "speeddata vScan:=[50,20,50,20]",
    "urscript": "v=0.050",
}


class InCell(Controller):
    """A controller whose arm is the simulated cell's; those that run at once go to each stop together."""

    def __init__(self, cell: Rig, stops: Sequence[int], together: Barrier) -> None:
        super().__init__()
        self._cell, self._stops, self._together = cell, stops, together
        self._moves = 0

    def move(self, base_from_tool0: RigidTransform) -> None:
        stop, part = divmod(self._moves, 3)  # to the approach, to the stop, back to the approach
        self._moves += 1
        shot = self._cell.cell.shots[self._stops[stop]]
        away = np.linalg.norm(base_from_tool0.translation_mm - shot.reported[:3, 3])
        assert away == pytest.approx(0.0 if part == 1 else 150.0, abs=2e-3)
        if part == 1 and self._together.wait(300) == 0:
            self._cell.go(self._stops[stop])
        if part == 1:
            self._together.wait(300)
            until(lambda: not self._cell.cell.at(self._cell.now()).moving)

    def where(self) -> RigidTransform:
        return RigidTransform(self._cell.cell.at(self._cell.now()).reported, "base", "tool0")


@pytest.fixture
def cell(tmp_path: Path) -> Any:
    with rig(tmp_path / "exposures", every_s=0.08, travel_s=0.1) as made:
        yield made


class Running:
    """Programs of some dialects as the workbench writes them, each for its own session, run at once."""

    def __init__(self, client: httpx.Client, cell: Rig, stops: Sequence[int], names: Sequence[str]) -> None:
        self._client = client
        self.sessions: dict[str, str] = {}
        self.robots: dict[str, InCell] = {}
        together = Barrier(len(names))
        programs: dict[str, dict[str, str]] = {}
        for name in names:
            session = self.sessions[name] = self._session(name, cell)
            self.robots[name] = InCell(cell, stops, together)
            programs[name] = self._program(name, cell, stops)
        until(
            lambda: all(d["status"] == "live" for s in self.sessions.values() for d in devices(client, s).values())
        )
        with ThreadPoolExecutor(len(names)) as pool:
            runs = [pool.submit(self._run, name, programs[name], together) for name in names]
            for one in sorted(runs, key=lambda run: isinstance(run.exception(), BrokenBarrierError)):
                one.result()
        for session in self.sessions.values():
            client.delete(f"/sessions/{session}/robot-port")
            for device in devices(client, session):
                client.delete(f"/sessions/{session}/devices/{device}")

    def _run(self, name: str, files: dict[str, str], together: Barrier) -> None:
        try:
            INTERPRETERS[name](files, self.robots[name])
        except BaseException:
            together.abort()  # else the others would wait for it
            raise
        finally:
            self.robots[name].disconnect()

    def _session(self, name: str, cell: Rig) -> str:
        client = self._client
        own = {**ABB_CELL, "pose_convention": PROGRAMS.get(name).convention}
        session = make_session(client, name=f"program in {name}", cell=own)
        scanner = {"source": "frame-folder", "settings": {"folder": str(cell.folder)}}
        assert client.put(f"/sessions/{session}/devices/scanner", json=scanner).status_code == 200
        return session

    def _program(self, name: str, cell: Rig, stops: Sequence[int]) -> dict[str, str]:
        client, session, convention = self._client, self.sessions[name], PROGRAMS.get(name).convention
        port = client.put(f"/sessions/{session}/robot-port", json={}).json()["port"]
        poses = [to_pose(convention, RigidTransform(cell.cell.shots[k].reported, "base", "tool0")) for k in stops]
        plan = [{"id": f"p{k:02d}", "pose": list(pose)} for k, pose in enumerate(poses, start=1)]
        body = {"host": "127.0.0.1", "port": port, "token": token(client), "poses": plan}
        answer = client.post(f"/sessions/{session}/robot-programs/{name}", json=body)
        assert answer.status_code == 200, answer.text
        with zipfile.ZipFile(io.BytesIO(answer.content)) as zipped:
            return {entry: zipped.read(entry).decode("ascii") for entry in zipped.namelist()}


@pytest.mark.thorough
def test_the_program_of_each_dialect_takes_fourteen_captures(client: httpx.Client, cell: Rig) -> None:
    """One cell, and all dialects at once: what they run is the text that is loaded into the controllers."""
    stops = (cell.good * 2)[:14]
    ran = Running(client, cell, stops, PROGRAMS.names())
    for name, session in ran.sessions.items():
        assert ran.robots[name].starts == len(stops), name
        assert ran.robots[name].refused == 0, name
        found = captures(client, session)
        assert [capture["id"] for capture in found] == [f"p{k + 1:02d}" for k in range(14)], name
        for capture, number in zip(found, stops, strict=True):
            wanted = RigidTransform(cell.cell.shots[number].reported, "base", "tool0")
            told = parse_pose(PROGRAMS.get(name).convention, capture["pose"])
            assert np.abs(wanted.difference(told)).max() < 2e-3
        assert len(ran.robots[name].shown) == len(stops) + 2


@pytest.mark.thorough
def test_a_program_that_is_answered_no_asks_its_operator(client: httpx.Client, cell: Rig) -> None:
    weak = next(k for k in range(len(cell.cell.shots)) if cell.offset(k) < 0.28)
    ran = Running(client, cell, [weak], PROGRAMS.names())
    for name, session in ran.sessions.items():
        assert ran.robots[name].refused == 1, name
        assert captures(client, session) == []
