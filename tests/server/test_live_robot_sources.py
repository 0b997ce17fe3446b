"""Sources of robots: RSI against RSIPI's emulator, EGM in ABB's own messages, the others by replayed dialogues."""

import http.server
import json
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.errors import CalibrationError, InputError
from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose
from server.sources.device import Device, Sample
from server.sources.fanuc_curpos import parse_curpos
from server.sources.kuka_xml import parse_telegram
from server.sources.source import Settings
from tests.server.connected_device import connected, sample_of

JOINTS_DEG = (10.0, -80.0, 95.0, 5.0, 60.0, -15.0)
KUKA_POSE = [1210.5, -35.25, 980.0, 90.0, 10.0, -5.5]
TOOL = [0.0, 0.0, 150.0, 30.0, 0.0, 0.0]
FRAME = [500.0, 0.0, 0.0, 90.0, 0.0, 0.0]


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def assert_pose(sample: Sample, wanted: RigidTransform, within: float = 1e-9) -> None:
    assert sample.base_from_tool0 is not None
    assert np.abs(wanted.difference(sample.base_from_tool0)).max() < within


# KUKA

# The emulator alone: its package's first module would bring pandas and Matplotlib.
EMULATOR = """
import sys, time, types, importlib.util
package = types.ModuleType("RSIPI")
package.__path__ = list(importlib.util.find_spec("RSIPI").submodule_search_locations)
sys.modules["RSIPI"] = package
from RSIPI.rsi_echo_server import EchoServer
robot = EchoServer(sys.argv[1], delay_ms=4)
robot.state["RIst"].update(zip("XYZABC", (1210.5, -35.25, 980.0, 90.0, 10.0, -5.5)))
robot.start()
time.sleep(60)
"""

CONFIG = """<ROOT><CONFIG><IP_NUMBER>127.0.0.1</IP_NUMBER><PORT>{port}</PORT><SENTYPE>ImFree</SENTYPE>
<ONLYSEND>TRUE</ONLYSEND></CONFIG><SEND><ELEMENTS>
<ELEMENT TAG="DEF_RIst" TYPE="DOUBLE" INDX="INTERNAL"/><ELEMENT TAG="DEF_AIPos" TYPE="DOUBLE" INDX="INTERNAL"/>
</ELEMENTS></SEND><RECEIVE><ELEMENTS/></RECEIVE></ROOT>"""


def test_kuka_rsi_is_received_from_an_emulator(tmp_path: Path) -> None:
    """The emulator's own port is always 50000."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("0.0.0.0", 50000))
        except OSError:
            pytest.skip("port 50000 is taken")
    port = free_port(socket.SOCK_DGRAM)
    (tmp_path / "config.xml").write_text(CONFIG.format(port=port))
    process = subprocess.Popen(
        [sys.executable, "-c", EMULATOR, "config.xml"], cwd=tmp_path, stdout=subprocess.DEVNULL
    )
    try:
        device = connected("kuka-rsi", host="127.0.0.1", port=port, robot="127.0.0.1")
        first = next(found for _ in range(40) if (found := device.read()) is not None)
        later = sample_of(device)
    finally:
        process.kill()
        process.wait()
    assert isinstance(first, Sample)
    assert_pose(first, parse_pose("kuka", KUKA_POSE), 1e-6)
    assert first.joints_deg == (0.0,) * 6
    assert first.device_time_s is not None
    assert later.device_time_s is not None
    assert later.device_time_s > first.device_time_s


TELEGRAM = (
    '<Rob Type="KUKA"><RSol X="0" Y="0" Z="0" A="0" B="0" C="0"/>'
    '<RIst X="1210.5" Y="-35.25" Z="980.0" A="90.0" B="10.0" C="-5.5"/>'
    '<AIPos A1="10.0" A2="-80.0" A3="95.0" A4="5.0" A5="60.0" A6="-15.0"/>'
    '<EIPos E1="45.5" E2="0" E3="0" E4="0" E5="0" E6="0"/><Delay D="0"/><IPOC>4208163634</IPOC></Rob>'
)


def send_datagrams(port: int, *messages: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        for message in messages:
            robot.sendto(message, ("127.0.0.1", port))


def test_kuka_rsi_takes_tool_frame_and_external_axis_from_a_telegram() -> None:
    port = free_port(socket.SOCK_DGRAM)
    device = connected("kuka-rsi", host="127.0.0.1", port=port, tool=TOOL, frame=FRAME, table_axis="E1")
    send_datagrams(port, TELEGRAM.encode())
    found = sample_of(device)
    frame, at, tool = (parse_pose("kuka", numbers).matrix for numbers in (FRAME, KUKA_POSE, TOOL))
    flange = RigidTransform.from_rounded((frame @ at @ np.linalg.inv(tool)).tolist(), "base", "tool0")
    assert_pose(found, flange)
    assert (found.joints_deg, found.table_deg) == (JOINTS_DEG, 45.5)
    assert found.device_time_s == pytest.approx(4208163.634)


def test_kuka_rsi_leaves_out_what_others_send() -> None:
    port = free_port(socket.SOCK_DGRAM)
    device = connected("kuka-rsi", host="127.0.0.1", port=port, robot="192.0.2.1")
    send_datagrams(port, TELEGRAM.encode())
    assert device.read() is None
    device.close()


@pytest.mark.parametrize(
    "text",
    [
        "<Rob><RIst",
        "<!DOCTYPE x [<!ENTITY a 'b'>]><Rob/>",
        '<Rob><RIst X="a" Y="1" Z="1" A="1" B="1" C="1"/></Rob>',
        "<Rob><IPOC>soon</IPOC></Rob>",
    ],
)
def test_a_telegram_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        parse_telegram(text)


@contextmanager
def tcp_server(*chunks: bytes) -> Iterator[int]:
    """Serve one connection: these bytes, chunk by chunk."""
    listening = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        peer, _ = listening.accept()
        with peer:
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for chunk in chunks:
                peer.sendall(chunk)
            peer.recv(1)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        thread.join(5)
        listening.close()


EKI = (
    '<Robot><Pos X="1210.5" Y="-35.25" Z="980.0" A="90.0" B="10.0" C="-5.5"/><Ext E1="45.5"/></Robot>'
    "\r\n<Robot><Pos><X>1.5</X><Y>2</Y><Z>3</Z><A>0</A><B>0</B><C>0</C></Pos><Ext><E1>46</E1></Ext></Robot><Robot/>"
)


def test_kuka_eki_is_read_element_by_element() -> None:
    """The dialogue is replayed: no emulator of EKI could be had.  It comes cut at odd places."""
    data = EKI.encode()
    with tcp_server(data[:30], data[30:130], data[130:]) as port:
        device = connected("kuka-eki", host="127.0.0.1", port=port, table_axis="E1")
        first, second = device.read(), device.read()
        with pytest.raises(InputError, match="E1"):
            device.read()
        device.close()
    assert isinstance(first, Sample)
    assert isinstance(second, Sample)
    assert_pose(first, parse_pose("kuka", KUKA_POSE))
    assert_pose(second, parse_pose("kuka", [1.5, 2, 3, 0, 0, 0]))
    assert (first.table_deg, second.table_deg) == (45.5, 46.0)


# ABB


def egm_message(tm_ms: int) -> bytes:
    from ABBRobotEGM._egm_protobuf import egm_pb2

    message = egm_pb2.EgmRobot()
    message.header.seqno, message.header.tm = tm_ms // 4, tm_ms
    message.feedBack.joints.joints.extend(JOINTS_DEG)
    place, turn = message.feedBack.cartesian.pos, message.feedBack.cartesian.orient
    place.x, place.y, place.z = 364.35, 1.25, 594.0
    turn.u0, turn.u1, turn.u2, turn.u3 = 0.5, 0.5, 0.5, 0.5
    message.feedBack.externalJoints.joints.extend([45.5, 0.0])
    return message.SerializeToString()


def test_abb_egm_is_received_in_abbs_own_messages() -> None:
    """No emulator of EGM could be had: the messages are made with ABB's definitions, the robot's port is ours."""
    port = free_port(socket.SOCK_DGRAM)
    device = connected("abb-egm", port=port, robot="127.0.0.1", table_axis="E1")
    send_datagrams(port, b"\xff\xff\xff", egm_message(123_456))
    with pytest.raises(InputError, match="EGM"):
        device.read()
    found = sample_of(device)
    assert_pose(found, parse_pose("abb", [364.35, 1.25, 594.0, 0.5, 0.5, 0.5, 0.5]))
    assert found.joints_deg == JOINTS_DEG
    assert (found.table_deg, found.device_time_s) == (45.5, 123.456)
    device = connected("abb-egm", port=port, arm="ur10e")
    send_datagrams(port, egm_message(4))
    assert_pose(sample_of(device), flange_of_joints(NAMED_ARMS["ur10e"], JOINTS_DEG))


def test_the_peers_receiver_reads_the_same_egm_messages() -> None:
    """So the messages above are what the package's own client takes from controllers, not what ours likes."""
    from ABBRobotEGM import EGM

    port = free_port(socket.SOCK_DGRAM)
    with EGM(port) as peer:
        send_datagrams(port, egm_message(123_456))
        came, state = peer.receive_from_robot(5.0)
    assert came
    assert state is not None
    assert tuple(state.joint_angles) == JOINTS_DEG
    assert (state.cartesian.pos.x, state.cartesian.pos.y, state.cartesian.pos.z) == (364.35, 1.25, 594.0)
    assert (state.external_axes[0], state.header.tm) == (45.5, 123_456)


PAGE = """<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE html PUBLIC "-//W3C//DTD XHTML 1.0 Strict//EN" "http://www.w3.org/TR/xhtml1/DTD/xhtml1-strict.dtd">
<html xmlns="http://www.w3.org/1999/xhtml"><head><title>motionsystem</title><base href="http://localhost/rw/"/></head>
<body><div class="state"><a href="" rel="self"/><ul><li class="{kind}" title="ROB_1">{spans}</li></ul></div></body>
</html>
"""


def page(kind: str, **spans: object) -> str:
    return PAGE.format(kind=kind, spans="".join(f'<span class="{k}">{v}</span>' for k, v in spans.items()))


ROBTARGET = page(
    "ms-robtargets", x=515, y=0.5, z=712, q1=0.7071068, q2=0, q3=0.7071068, q4=0, cf1=0, cf4=0, cf6=0, cfx=0
)
JOINTTARGET = page(
    "ms-jointtarget",
    **{f"rax_{k + 1}": value for k, value in enumerate(JOINTS_DEG)},
    **{"eax_a": 45.5, **{f"eax_{k}": "8.999999E+09" for k in "bcdef"}},
)


@contextmanager
def web_server(pages: Mapping[str, str], challenge: str = "") -> Iterator[tuple[int, list[str]]]:
    """Serve pages by the beginning of their addresses; with a challenge, to those that answer it alone."""
    asked: list[str] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            given = self.headers.get("Authorization", "")
            asked.append(f"{self.path} {given.partition(' ')[0]}".strip())
            found = next((text for start, text in pages.items() if self.path.startswith(start)), None)
            refused = challenge and not given
            content = b"" if refused or found is None else found.encode("latin-1")
            self.send_response(401 if refused else 200 if found is not None else 404)
            if refused:
                self.send_header("WWW-Authenticate", challenge)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: Any) -> None:
            """Write nothing."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server.server_address[1], asked
    finally:
        server.shutdown()
        server.server_close()
        thread.join(5)


@pytest.mark.parametrize(
    ("challenge", "scheme"),
    [
        ('Digest realm="validusers@robapi.abb", domain="/", qop="auth", nonce="2c31", algorithm="MD5"', "Digest"),
        ('Basic realm="ABB"', "Basic"),
    ],
)
def test_abb_robot_web_services_of_both_generations(challenge: str, scheme: str) -> None:
    """The dialogue is replayed from ABB's published pages: no emulator could be had."""
    unit = "/rw/motionsystem/mechunits/ROB_1"
    pages = {
        f"{unit}/robtarget?tool=tool0&wobj=wobj0&coordinate=Base": ROBTARGET,
        f"{unit}/jointtarget": JOINTTARGET,
    }
    with web_server({**pages, "/logout": "", "/rw/system": ""}, challenge) as (port, asked):
        found = sample_of(connected("abb-rws", url=f"http://127.0.0.1:{port}", table_axis="E1"))
    assert_pose(found, parse_pose("abb", [515, 0.5, 712, 0.7071068, 0, 0.7071068, 0]), 1e-6)
    assert found.joints_deg == JOINTS_DEG
    assert (found.table_deg, found.active_tool, found.active_frame) == (45.5, "tool0", "wobj0")
    assert f"{unit}/jointtarget {scheme}" in asked
    assert asked[-1].startswith("/logout")


def test_abb_robot_web_services_say_what_is_wrong() -> None:
    unit = "/rw/motionsystem/mechunits/ROB_1"
    with web_server({f"{unit}/jointtarget": "<html><body/></html>", "/rw/system": "", "/logout": ""}) as (port, _):
        device = connected("abb-rws", url=f"http://127.0.0.1:{port}")
        with pytest.raises(InputError, match="ms-jointtarget"):
            device.read()
        device.close()
        device = connected("abb-rws", url=f"http://127.0.0.1:{port}", unit="ROB_2")
        with pytest.raises(InputError, match="404"):
            device.read()
        device.close()


# FANUC

CURPOS = """<HTML><BODY><PRE>
F Number: F00000
VERSION : HandlingTool
$VERSION: V8.30126      10/28/2024
DATE:     12-JUN-26 08:48

CURRENT ROBOT POSITION::
Group #:  1

CURRENT JOINT POSITION:
Joint   1:     10.00
Joint   2:    -80.00
Joint   3:     95.00
Joint   4:      5.00
Joint   5:     60.00
Joint   6:      -.15
EXTAXS:
1:    100.00

Frame #:  3  Tool #:  {tool}
CURRENT USER FRAME POSITION:
CFG: N U T, 0, 0, 0
X:    111.11
Y:    222.22
Z:    333.33
W:     44.44
P:      5.55
R:     66.66

Tool #:  {tool}
CURRENT WORLD POSITION:
{world}

CURRENT ROBOT POSITION::
Group #:  2

CURRENT JOINT POSITION:
Joint   1:     45.50

Frame #:  0  Tool #:  1
CURRENT USER FRAME POSITION: NOT CALIBRATED
CURRENT WORLD POSITION: NOT CALIBRATED
</PRE></BODY></HTML>
"""
WORLD = [2032.71, -70.8, 1840.86, -139.75, 0.99, -98.93]
OLD = "".join(f"{k}: {v:9.2f}\n" for k, v in zip("XYZWPR", WORLD, strict=True)) + "CFG: N U T, 0, 0, 0\n"
NEW = "CFG: N U T, 0, 0, 0\n" + "".join(f"{k}: {v:9.2f}\r\n" for k, v in zip("XYZWPR", WORLD, strict=True))


def curpos(world: str, active: int, **settings: Any) -> Sample:
    """The file is replayed as controllers of two generations write it: no emulator could be had."""
    with web_server({"/MD/CURPOS.DG": CURPOS.format(tool=active, world=world)}) as (port, _):
        return sample_of(connected("fanuc-curpos", host="127.0.0.1", port=port, **settings))


@pytest.mark.parametrize("world", [OLD, NEW])
def test_fanuc_tells_the_flange_of_utool_0_and_the_table(world: str) -> None:
    found = curpos(world, 0, table_group=2)
    assert_pose(found, parse_pose("fanuc", WORLD))
    assert found.joints_deg == (10.0, -80.0, 95.0, 5.0, 60.0, -0.15)
    assert (found.table_deg, found.active_tool) == (45.5, 0)
    assert curpos(world, 0, table_axis="E1").table_deg == 100.0


def test_fanuc_with_another_tool_needs_its_place() -> None:
    tool = [10.0, 0.0, 200.0, 0.0, 30.0, 0.0]
    matrix = parse_pose("fanuc", WORLD).matrix @ np.linalg.inv(parse_pose("fanuc", tool).matrix)
    found = curpos(NEW, 7, tool=tool)
    assert_pose(found, RigidTransform.from_rounded(matrix.tolist(), "base", "tool0"))
    assert found.active_tool == 7
    with pytest.raises(InputError, match="UTOOL 7"):
        curpos(NEW, 7)
    with pytest.raises(InputError, match="calibrated"):
        curpos("NOT CALIBRATED", 0)
    with pytest.raises(InputError, match="groups 1, 2"):
        curpos(NEW, 0, group=3)
    with pytest.raises(InputError, match="table"):
        curpos(NEW, 0, table_group=4)


def test_a_file_that_breaks_off_is_never_another_pose() -> None:
    for world in (OLD, NEW):
        text = CURPOS.format(tool=0, world=world)
        whole = parse_curpos(text)[1]
        for end in range(len(text)):
            found = parse_curpos(text[:end]).get(1, whole)
            assert found["world"] in ((), whole["world"])
            assert found["joints"] == whole["joints"][: len(found["joints"])]


# ROS


def stamp(seconds: int) -> dict[str, Any]:
    return {"stamp": {"sec": seconds, "nanosec": 500_000_000}, "frame_id": ""}


def transform(parent: str, child: str, place: list[float], turn: list[float], seconds: int = 7) -> dict[str, Any]:
    return {
        "header": {**stamp(seconds), "frame_id": parent},
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", place, strict=True)),
            "rotation": dict(zip("xyzw", turn, strict=True)),
        },
    }


HALF = [0.0, 0.0, 0.7071067811865476, 0.7071067811865476]
NO_TURN = [0.0, 0.0, 0.0, 1.0]
NAMES = ["table", "a2", "a1", "a3", "a4", "a5", "a6"]
SENT = {
    "/tf_static": {"transforms": [transform("wrist", "tool0", [0, 0, 0.1], NO_TURN)]},
    "/tf": {"transforms": [transform("base", "wrist", [1, 0, 0.5], HALF)]},
    "/joint_states": {
        "header": stamp(8),
        "name": NAMES,
        "position": np.deg2rad([45.5, JOINTS_DEG[1], JOINTS_DEG[0], *JOINTS_DEG[2:]]).tolist(),
    },
    "/pose": {
        "header": stamp(9),
        "pose": {
            "position": {"x": 0.4, "y": -0.2, "z": 0.3},
            "orientation": dict(zip("xyzw", HALF, strict=True)),
        },
    },
}


@contextmanager
def bridge(sent: Mapping[str, Any], raw: str | None = None) -> Iterator[str]:
    """Serve rosbridge's protocol: each subscription is answered with a message of its topic."""
    from websockets.sync.server import serve

    def talk(peer: Any) -> None:
        for text in peer:
            asked = json.loads(text)
            topic = asked.get("topic")
            if asked["op"] == "subscribe" and topic in sent:
                peer.send(raw or json.dumps({"op": "publish", "topic": topic, "msg": sent[topic]}))

    with serve(talk, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()
        thread.join(5)


def test_ros_tells_the_flange_by_tf_a_pose_or_joints() -> None:
    with bridge(SENT) as url:
        found = sample_of(connected("rosbridge", url=url))
        assert_pose(found, parse_pose("ros", [1, 0, 0.6, *HALF]), 1e-6)
        assert found.device_time_s == 7.5
        found = sample_of(connected("rosbridge", url=url, pose_topic="/pose"))
        assert_pose(found, parse_pose("ros", [0.4, -0.2, 0.3, *HALF]))
        assert found.device_time_s == 9.5
        joints = [f"a{k}" for k in range(1, 7)]
        found = sample_of(connected("rosbridge", url=url, arm="ur10e", joints=joints, table_joint="table"))
        assert_pose(found, flange_of_joints(NAMED_ARMS["ur10e"], JOINTS_DEG), 1e-6)
        assert found.joints_deg == pytest.approx(JOINTS_DEG)
        assert found.table_deg == pytest.approx(45.5)


@pytest.mark.parametrize(
    "raw",
    [
        "no JSON",
        "[1]",
        '{"op": "publish", "topic": "/pose", "msg": {"header": {}}}',
        '{"op": "publish", "topic": "/pose", "msg": {"header": {"stamp": {}}, "pose": {"position": "x"}}}',
        '{"op": "status", "level": "error", "msg": "no such type"}',
    ],
)
def test_what_a_bridge_sends_wrongly_is_refused(raw: str) -> None:
    with bridge({"/pose": {}}, raw) as url:
        device = connected("rosbridge", url=url, pose_topic="/pose")
        with pytest.raises(InputError):
            device.read()
        device.close()


PEER = """
import sys, threading, roslibpy
client = roslibpy.Ros(host="127.0.0.1", port=int(sys.argv[1]))
client.run(timeout=10)
heard = threading.Event()
def listen(message):
    print(message["pose"]["position"], flush=True)
    heard.set()
roslibpy.Topic(client, "/pose", "geometry_msgs/PoseStamped").subscribe(listen)
assert heard.wait(10)
client.terminate()
"""


def test_a_peers_client_hears_the_same_bridge() -> None:
    with bridge(SENT) as url:
        done = subprocess.run(
            [sys.executable, "-c", PEER, url.rpartition(":")[2]],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
    assert str(SENT["/pose"]["pose"]["position"]) in done.stdout


@pytest.mark.parametrize(
    "connect",
    [
        lambda: connected("kuka-eki", host="127.0.0.1", port=9),
        lambda: connected("fanuc-curpos", host="127.0.0.1", port=9),
        lambda: connected("rosbridge", url="ws://127.0.0.1:9"),
    ],
)
def test_a_robot_that_is_not_there_says_so(connect: Callable[[], Device]) -> None:
    with pytest.raises(OSError):  # noqa: PT011
        connect()


def test_settings_of_tool_and_frame_are_judged() -> None:
    from server.sources.pose_settings import ToolAndFrame, flange_of

    assert issubclass(ToolAndFrame, Settings)
    pose = parse_pose("kuka", KUKA_POSE)
    with pytest.raises(CalibrationError, match="tool"):
        flange_of(ToolAndFrame(tool=[1.0, 2.0]), "kuka", pose)
