"""Sources of the workbench before devices that tell, in their own protocols, what a faulty wire lets through."""

import json
import socket
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from typing import Any

import numpy as np
from faulty_robot import FaultyStream, Wire, samples

from calib_core.robots import to_pose
from calib_core.simulation.live_camera import HEIGHT_PX, WIDTH_PX, LiveCamera
from server.simulated_cell.gige_server import GigeServer
from server.simulated_cell.kukavarproxy_server import KukaVarProxyServer
from server.simulated_cell.modbus_server import ANGLE, MOVING, ModbusServer
from server.simulated_cell.opcua_server import OpcUaServer
from server.simulated_cell.rtde_server import RtdeServer
from server.simulated_cell.stream_server import StreamServer
from server.sources.device import Sample, host_now_s
from tests.server.gige_network import only_camera
from tests.server.gocator_server import GocatorServer
from tests.server.live_rig import LineServer, Rig
from tests.server.test_live_robot_sources import CURPOS, free_port, page, web_server

Settings = dict[str, Any]
Told = Callable[[], Sample]
_HOME_DEG = (10.0, -80.0, 95.0, 5.0, 60.0, -15.0)
_EVERY_S = 0.02


def numbers(sample: Sample, convention: str) -> list[float]:
    """Return a reading's pose as a controller writes it."""
    assert sample.base_from_tool0 is not None
    return list(to_pose(convention, sample.base_from_tool0))


@contextmanager
def _stopped(server: Any, **settings: Any) -> Iterator[Settings]:
    try:
        yield settings
    finally:
        server.stop()


def _lines(told: Told):
    server = LineServer(lambda: (" ".join(map(str, numbers(told(), "abb"))) + "\r\n").encode())
    return _stopped(server, host="127.0.0.1", port=server.port, convention="abb")


def _telegram(sample: Sample) -> bytes:
    place = "".join(f' {k}="{v:.6f}"' for k, v in zip("XYZABC", numbers(sample, "kuka"), strict=True))
    stamp = round((sample.device_time_s or 0.0) * 1000)
    return f'<Rob Type="KUKA"><RIst{place}/><IPOC>{stamp}</IPOC></Rob>'.encode()


def _eki(told: Told):
    server = LineServer(lambda: _telegram(told()))
    return _stopped(server, host="127.0.0.1", port=server.port)


def _egm_message(sample: Sample) -> bytes:
    from ABBRobotEGM._egm_protobuf import egm_pb2

    sent = egm_pb2.EgmRobot()
    stamp = round((sample.device_time_s or 0.0) * 1000) % 2**32
    sent.header.seqno, sent.header.tm = stamp, stamp
    sent.feedBack.joints.joints.extend(_HOME_DEG)
    x, y, z, *turn = numbers(sample, "abb")
    place, orient = sent.feedBack.cartesian.pos, sent.feedBack.cartesian.orient
    place.x, place.y, place.z = x, y, z
    orient.u0, orient.u1, orient.u2, orient.u3 = turn
    return sent.SerializeToString()


@contextmanager
def _sent(message: Callable[[], bytes], **settings: Any) -> Iterator[Settings]:
    """Send datagrams to a source that listens."""
    stopped, port = threading.Event(), free_port(socket.SOCK_DGRAM)

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
            while not stopped.wait(_EVERY_S):
                robot.sendto(message(), ("127.0.0.1", port))

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    yield {"port": port, **settings}
    stopped.set()
    thread.join(5)


def _rsi(told: Told):
    return _sent(lambda: _telegram(told()), host="127.0.0.1")


def _egm(told: Told):
    return _sent(lambda: _egm_message(told()))


def _rtde(told: Told):
    def outputs(_: float) -> Mapping[str, tuple[float, ...]]:
        sample = told()
        return {
            "timestamp": (sample.device_time_s or 0.0,),
            "actual_q": tuple(np.deg2rad(_HOME_DEG)),
            "actual_TCP_pose": tuple(numbers(sample, "ur")),
            "actual_TCP_speed": (float(bool(sample.moving)), *(0.0,) * 5),
        }

    server = RtdeServer(outputs)
    return _stopped(server, host="127.0.0.1", port=server.port)


def _variables(told: Told):
    zero = "{FRAME: X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}"

    def variable(name: str) -> str:
        if name == "$ROB_STOPPED":
            return "FALSE" if told().moving else "TRUE"
        if name != "$POS_ACT":
            told_of = {"$TOOL": zero, "$BASE": zero, "$ACT_TOOL": "0", "$ACT_BASE": "0"}
            return told_of.get(name, "{E6AXIS: A1 0.0, A2 0.0, A3 0.0, A4 0.0, A5 0.0, A6 0.0}")
        pairs = zip("XYZABC", numbers(told(), "kuka"), strict=True)
        return "{E6POS: " + ", ".join(f"{letter} {value:.6f}" for letter, value in pairs) + ", S 2, T 35}"

    server = KukaVarProxyServer(variable)
    return _stopped(server, host="127.0.0.1", port=server.port)


def _opcua(told: Told):
    server = OpcUaServer(lambda: {"Pose": numbers(told(), "quaternion-xyzw")})  # stamps anew what it is told
    return _stopped(server, url=server.url, pose=["ns=2;s=Pose"])


class _Pages(dict[str, str]):
    """Pages that are written when they are asked for."""

    def __init__(self, written: Mapping[str, Callable[[], str]]) -> None:
        super().__init__()
        self._written = written

    def items(self) -> Any:
        return ((start, _Late(write)) for start, write in self._written.items())


@dataclass
class _Late:
    write: Callable[[], str]

    def encode(self, encoding: str) -> bytes:
        return self.write().encode(encoding)


@contextmanager
def _rws(told: Told) -> Iterator[Settings]:
    def robtarget() -> str:
        names = ("x", "y", "z", "q1", "q2", "q3", "q4")
        return page("ms-robtargets", **dict(zip(names, numbers(told(), "abb"), strict=True)))

    unit = "/rw/motionsystem/mechunits/ROB_1"
    joints = page("ms-jointtarget", **{f"rax_{k}": 0.0 for k in range(1, 7)})
    pages = {
        f"{unit}/robtarget": robtarget,
        f"{unit}/jointtarget": lambda: joints,
        "/logout": str,
        "/rw/system": str,
    }
    with web_server(_Pages(pages)) as (port, _):
        yield {"url": f"http://127.0.0.1:{port}"}


@contextmanager
def _fanuc(told: Told) -> Iterator[Settings]:
    def curpos() -> str:
        pairs = zip("XYZWPR", numbers(told(), "fanuc"), strict=True)
        world = "CFG: N U T, 0, 0, 0\n" + "".join(f"{k}: {v:9.2f}\r\n" for k, v in pairs)
        return CURPOS.format(tool=0, world=world)

    with web_server(_Pages({"/MD/CURPOS.DG": curpos})) as (port, _):
        yield {"host": "127.0.0.1", "port": port}


@contextmanager
def _ros(told: Told) -> Iterator[Settings]:
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import serve

    def talk(peer: Any) -> None:
        peer.recv()
        while True:
            time.sleep(_EVERY_S)
            sample = told()
            place = numbers(sample, "ros")
            seconds = sample.device_time_s or 0.0
            stamp = {"sec": int(seconds), "nanosec": round(seconds % 1 * 1e9)}
            position, turn = dict(zip("xyz", place[:3], strict=True)), dict(zip("xyzw", place[3:], strict=True))
            said = {"header": {"stamp": stamp}, "pose": {"position": position, "orientation": turn}}
            try:
                peer.send(json.dumps({"op": "publish", "topic": "/pose", "msg": said}))
            except ConnectionClosed:
                return

    with serve(talk, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield {"url": f"ws://127.0.0.1:{server.socket.getsockname()[1]}", "pose_topic": "/pose"}
        server.shutdown()
        thread.join(5)


ROBOTS = {
    "pose-lines": _lines,
    "kuka-eki": _eki,
    "kuka-rsi": _rsi,
    "abb-egm": _egm,
    "ur-rtde": _rtde,
    "rosbridge": _ros,
    "opcua": _opcua,
    "abb-rws": _rws,
    "kukavarproxy": _variables,
    "fanuc-curpos": _fanuc,
}
"""Devices by the name of the source that reads them."""


@dataclass(frozen=True)
class _Seen:
    """What a scanner saw: a profile's text, or an image."""

    host_time_s: float
    device_time_s: float
    content: Any


def _profiles(rig: Rig, wire: Wire) -> Callable[[], tuple[bytes, float]]:
    """Return what gives a scanner's profiles, as text with their times."""
    rng = np.random.default_rng(5)

    def seen() -> _Seen:
        now_s = host_now_s()
        content = rig.cell.profile(now_s, rng)
        wire.exposed_s[content] = now_s
        return _Seen(now_s, now_s, content)

    stream = FaultyStream(seen, wire)

    def told() -> tuple[bytes, float]:
        one = stream()
        return one.content, one.device_time_s

    return told


def _gocator(rig: Rig, wire: Wire):
    told = _profiles(rig, wire)

    def expose() -> tuple[np.ndarray, float]:
        text, moment_s = told()
        return np.genfromtxt(BytesIO(text), delimiter=",", skip_header=1)[:, :2], moment_s

    server = GocatorServer(expose)
    return _stopped(server, host="127.0.0.1", port=server.port)


def _stream(rig: Rig, wire: Wire):
    told = _profiles(rig, wire)

    def expose() -> tuple[bytes, str, float]:
        text, moment_s = told()
        return text, "text/csv", moment_s

    server = StreamServer(expose)
    return _stopped(server, url=server.url)


@contextmanager
def _folder(rig: Rig, wire: Wire) -> Iterator[Settings]:
    """Write what a scanner's program has, which stamps each file with the time of writing."""
    told, stopped, folder = _profiles(rig, wire), threading.Event(), rig.folder.with_name("faulty")
    folder.mkdir()

    def write() -> None:
        number = 0
        while not stopped.wait(0.05):
            number += 1
            temporary = folder / ".writing"
            temporary.write_bytes(told()[0])
            temporary.replace(folder / f"{number:06d}.csv")
            (folder / f"{number - 40:06d}.csv").unlink(missing_ok=True)

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    yield {"folder": str(folder)}
    stopped.set()
    thread.join(5)


@contextmanager
def _genicam(rig: Rig, wire: Wire) -> Iterator[Settings]:
    rng = np.random.default_rng(5)
    lens = LiveCamera(rng)

    def seen() -> _Seen:
        now_s = host_now_s()
        image = lens.image(rig.cell.points(now_s, rng), rng)
        wire.exposed_s[sha256(image.tobytes()).digest()] = now_s
        return _Seen(now_s, now_s, image)

    stream = FaultyStream(seen, wire)

    def expose(_: float) -> tuple[np.ndarray, float]:
        told = stream()
        return told.content, told.device_time_s

    with only_camera():
        server = GigeServer(expose, (WIDTH_PX, HEIGHT_PX), 20.0)
        with _stopped(server, address="127.0.0.1", interface="127.0.0.1") as at:
            yield at


SCANNERS = {"gocator": _gocator, "genicam": _genicam, "image-stream": _stream, "frame-folder": _folder}


def _modbus(told: Told):
    server = ModbusServer(lambda: ((sample := told()).table_deg or 0.0, bool(sample.moving)))
    return _stopped(server, host="127.0.0.1", port=server.port, address=ANGLE, moving=MOVING)


TABLES = {"modbus": _modbus}


_ASKED_TWICE = ("kukavarproxy", "modbus")
"""They are asked for where they are and for whether they move: a fault changes both answers alike."""


def _for_both(told: Told) -> Told:
    kept: list[Sample] = []

    def next_one() -> Sample:
        if kept:
            return kept.pop()
        kept.append(told())
        return kept[0]

    return next_one


@contextmanager
def device(name: str, rig: Rig, wire: Wire) -> Generator[Settings]:
    """Serve a device behind a faulty wire; give the settings with which its source reads it."""
    if name in SCANNERS:
        with SCANNERS[name](rig, wire) as settings:
            yield settings
        return

    told = FaultyStream(samples(lambda: rig.cell.at(time.monotonic()), "every-reading"), wire)
    with {**ROBOTS, **TABLES}[name](_for_both(told) if name in _ASKED_TWICE else told) as settings:
        yield settings
