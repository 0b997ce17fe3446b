"""The simulated cell beside the server: its robot sends poses, its scanner writes profiles into a folder."""

import socket
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from calib_core.simulation import simulate
from calib_core.simulation.live_cell import LiveCell
from calib_core.simulation.profile_cell import pose_numbers


class LineServer:
    """A controller's TCP server: sends `line()` to whoever is connected, about fifty times a second."""

    def __init__(self, line: Callable[[], bytes]) -> None:
        self.line = line
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.1)
        self.port: int = self._server.getsockname()[1]
        self.refuses = threading.Event()
        self.pauses = threading.Event()
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        peers: list[socket.socket] = []
        while not self._stopped.is_set():
            with suppress(TimeoutError):
                self._server.settimeout(0.002)
                peers.append(self._server.accept()[0])
            if self.refuses.is_set():
                while peers:
                    peers.pop().close()
            for peer in list(peers):
                try:
                    if not self.pauses.is_set():
                        peer.sendall(self.line())
                except OSError:
                    peers.remove(peer)
                    peer.close()
            time.sleep(0.02)
        for peer in peers:
            peer.close()
        self._server.close()

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()


class Rig:
    """The simulated cell, its robot's line server and its scanner's folder."""

    def __init__(
        self, folder: Path, scenario: str = "tcp", seed: int = 7, every_s: float = 0.05, travel_s: float = 0.4
    ) -> None:
        self.simulated = simulate(scenario, seed)
        self.cell = LiveCell(self.simulated, travel_s)
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.blind = threading.Event()
        self._every_s = every_s
        self._stopped = threading.Event()
        self.robot = LineServer(self.pose_line)
        self._thread = threading.Thread(target=self._expose)
        self._thread.start()

    @property
    def good(self) -> list[int]:
        """The captures in which the stripe lies where it says most: others are refused."""
        return [k for k in range(len(self.cell.shots)) if 0.4 < self.offset(k) < 0.75]

    def offset(self, number: int) -> float:
        """How far the sphere's centre is from the plane of light in a capture, in radii."""
        return abs(self.cell.shots[number].sphere_center_in_laser_mm[1]) / self.cell.world.sphere_radius_mm

    def now(self) -> float:
        return time.monotonic()

    def pose_line(self) -> bytes:
        numbers = pose_numbers(self.cell.at(time.monotonic()).reported)
        return (" ".join(map(str, numbers)) + "\r\n").encode()

    def go(self, number: int) -> None:
        self.cell.go(number, time.monotonic())

    def _expose(self) -> None:
        rng = np.random.default_rng(5)
        number = 0
        while not self._stopped.wait(self._every_s):
            if self.blind.is_set():
                continue
            number += 1
            temporary = self.folder / ".writing"
            temporary.write_bytes(self.cell.profile(time.monotonic(), rng))
            temporary.replace(self.folder / f"{number:06d}.csv")
            (self.folder / f"{number - 40:06d}.csv").unlink(missing_ok=True)

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()
        self.robot.stop()

    def connect(self, client: httpx.Client, session: str) -> None:
        robot = {"host": "127.0.0.1", "port": self.robot.port, "convention": "abb"}
        scanner = {"folder": str(self.folder)}
        for name, source, settings in (("robot", "pose-lines", robot), ("scanner", "frame-folder", scanner)):
            answer = client.put(
                f"/sessions/{session}/devices/{name}", json={"source": source, "settings": settings}
            )
            assert answer.status_code == 200, answer.text


@contextmanager
def rig(folder: Path, **options: Any) -> Generator[Rig]:
    made = Rig(folder, **options)
    try:
        yield made
    finally:
        made.stop()


def until(found: Callable[[], Any], what: Callable[[], Any] = lambda: "", timeout_s: float = 300.0) -> Any:
    """Return what `found` returns once it is true."""
    end_s = time.monotonic() + timeout_s
    while not (value := found()):
        assert time.monotonic() < end_s, what()
        time.sleep(0.05)
    return value
