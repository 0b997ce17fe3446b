"""Live sources against real servers (asyncua, pymodbus), and against ours, which peers' clients read too."""

import subprocess
import sys
import time
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from py_openshowvar import openshowvar

from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.errors import InputError
from server.simulated_cell.kukavarproxy_server import KukaVarProxyServer
from server.simulated_cell.modbus_server import ModbusServer
from server.simulated_cell.opcua_server import OpcUaServer
from server.simulated_cell.rtde_server import RtdeServer
from server.simulated_cell.stream_server import StreamServer
from server.sources.device import Device, Frame, Sample
from tests.server.connected_device import connected, sample_of

JOINTS_DEG = (10.0, -80.0, 95.0, 5.0, 60.0, -15.0)
OUTPUTS = {
    "actual_q": tuple(np.deg2rad(JOINTS_DEG).tolist()),
    "actual_TCP_pose": (0.4, -0.2, 0.3, 0.0, 0.0, 1.0),
    "actual_TCP_speed": (0.0,) * 6,
}
VARIABLES = {
    "$POS_ACT": "{E6POS: X 100.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0, S 2, T 3, E1 0.0}",
    "$TOOL": "{FRAME: X 0.0, Y 0.0, Z 10.0, A 0.0, B 0.0, C 0.0}",
    "$BASE": "{FRAME: X 0.0, Y 0.0, Z 0.0, A 90.0, B 0.0, C 0.0}",
    "$AXIS_ACT": "{E6AXIS: A1 10.0, A2 -80.0, A3 95.0, A4 5.0, A5 6.0E1, A6 -15.0, E1 45.5, E2 0.0}",
    "$ROB_STOPPED": "TRUE",
    "$ACT_TOOL": "1",
    "$ACT_BASE": "3",
}


@pytest.mark.thorough
def test_opcua_tells_pose_table_and_source_times() -> None:
    values = {"Pose": [100.0, 200.0, 300.0, 0.0, 0.0, 0.0, 1.0], "Moving": False, "Table": 0.5, "Tool": 3}
    server = OpcUaServer(lambda: values)
    try:
        nodes = {name: f"ns=2;s={node}" for name, node in (("table", "Table"), ("moving", "Moving"))}
        pose = ["ns=2;s=Pose"]
        device = connected(
            "opcua", url=server.url, pose=pose, table_unit="rad", active_tool="ns=2;s=Tool", **nodes
        )
        before_s = time.time()
        time.sleep(0.1)
        found = sample_of(device)
        assert found.base_from_tool0 is not None
        assert found.base_from_tool0.translation_mm.tolist() == [100, 200, 300]
        assert found.table_deg == pytest.approx(np.rad2deg(0.5))
        assert (found.moving, found.active_tool) == (False, 3)
        assert found.device_time_s is not None
        assert before_s <= found.device_time_s <= time.time()
        wrong = connected("opcua", url=server.url, pose=["ns=2;s=Nothing"])
        with pytest.raises(InputError, match="Nothing"):
            wrong.read()
        wrong.close()
    finally:
        server.stop()
    with pytest.raises(OSError):  # noqa: PT011
        connected("opcua", url=server.url, pose=["ns=2;s=Pose"])


@pytest.mark.thorough
def test_opcua_joints_give_the_flange_of_a_named_arm() -> None:
    server = OpcUaServer(lambda: {f"A{k}": value for k, value in enumerate(JOINTS_DEG)})
    try:
        joints = [f"ns=2;s=A{k}" for k in range(6)]
        found = sample_of(connected("opcua", url=server.url, joints=joints, arm="ur10e"))
    finally:
        server.stop()
    assert found.joints_deg == pytest.approx(JOINTS_DEG)
    assert found.base_from_tool0 is not None
    wanted = flange_of_joints(NAMED_ARMS["ur10e"], JOINTS_DEG)
    assert np.abs(wanted.difference(found.base_from_tool0)).max() < 1e-9


def test_modbus_tells_the_table() -> None:
    server = ModbusServer(lambda: (-45.125, True))
    try:
        found = sample_of(connected("modbus", host="127.0.0.1", port=server.port, address=100, moving=10))
        assert (found.table_deg, found.moving) == (-45.125, True)
        wrong = connected("modbus", host="127.0.0.1", port=server.port, address=500)
        with pytest.raises(InputError, match="exception 2"):
            wrong.read()
        wrong.close()
    finally:
        server.stop()
    with pytest.raises(ConnectionError):
        connected("modbus", host="127.0.0.1", port=server.port, address=100)


@pytest.mark.parametrize("offset_mm", [None, 120.0])
def test_rtde_tells_the_flange_without_the_tools_offset(offset_mm: float | None) -> None:
    told: dict[str, tuple[float, ...]] = {"timestamp": (12.5,), **OUTPUTS}
    if offset_mm is not None:
        told["tcp_offset"] = (0.0, 0.0, offset_mm / 1000, 0.0, 0.0, 0.0)
    server = RtdeServer(lambda _: told)
    try:
        found = sample_of(connected("ur-rtde", host="127.0.0.1", port=server.port))
    finally:
        server.stop()
    assert found.base_from_tool0 is not None
    assert found.base_from_tool0.translation_mm == pytest.approx([400, -200, 300 - (offset_mm or 0)])
    assert found.joints_deg == pytest.approx(JOINTS_DEG)
    assert (found.device_time_s, found.moving) == (12.5, False)


def test_a_simulated_controller_that_is_held_up_leaves_no_cycle_out() -> None:
    held_up = iter([0.0, 0.0, 0.3])

    def outputs(moment_s: float) -> dict[str, tuple[float, ...]]:
        time.sleep(next(held_up, 0.0))
        return {"timestamp": (moment_s,), **OUTPUTS}

    server = RtdeServer(outputs)
    device = connected("ur-rtde", host="127.0.0.1", port=server.port, frequency_hz=50)
    try:
        read = [device.read() for _ in range(24)]
    finally:
        device.close()
        server.stop()
    times_s = [sample.device_time_s for sample in read if isinstance(sample, Sample)]
    assert len(times_s) > 20
    assert np.diff(np.array(times_s, dtype=float)) == pytest.approx(0.02)


PEER = """
import rtde_receive, time
peer = rtde_receive.RTDEReceiveInterface("127.0.0.1", 50.0, ["timestamp", "actual_q", "actual_TCP_pose"])
time.sleep(0.2)
print(peer.getActualTCPPose(), peer.getActualQ())
peer.disconnect()
"""


@pytest.mark.thorough
def test_a_peers_client_reads_our_rtde_server() -> None:
    """The peer knows one port alone."""
    try:
        server = RtdeServer(lambda moment_s: {"timestamp": (moment_s,), **OUTPUTS}, port=30004)
    except OSError:
        pytest.skip("port 30004 is taken")
    try:
        done = subprocess.run([sys.executable, "-c", PEER], capture_output=True, text=True, timeout=60, check=True)
    finally:
        server.stop()
    assert f"{list(OUTPUTS['actual_TCP_pose'])} {list(OUTPUTS['actual_q'])}" in done.stdout


def test_kuka_variables_give_the_flange_in_the_base() -> None:
    server = KukaVarProxyServer(lambda name: VARIABLES.get(name, ""))
    try:
        found = sample_of(connected("kukavarproxy", host="127.0.0.1", port=server.port, table_axis="E1"))
        peer = openshowvar("127.0.0.1", server.port)
        assert peer.read("$AXIS_ACT", False).decode() == VARIABLES["$AXIS_ACT"]
        peer.sock.close()
    finally:
        server.stop()
    assert found.base_from_tool0 is not None
    assert found.base_from_tool0.translation_mm == pytest.approx([0, 100, -10], abs=1e-9)
    assert found.joints_deg == pytest.approx(JOINTS_DEG)
    assert (found.table_deg, found.moving, found.active_tool, found.active_frame) == (45.5, False, 1, 3)


@pytest.mark.parametrize("said", ["{E6POS: X 121\xff.5", "{E6POS: X 10.5.2", "{E6POS: X 1 0.5", "{E6POS: XX 10.5"])
def test_kuka_variables_of_which_a_byte_is_lost_are_refused(said: str) -> None:
    rest = ", Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0, S 2, T 35}"
    for at in (said + rest, "{E6POS: X 10.5" + rest[:-1], "X 10.5" + rest):
        told = VARIABLES | {"$POS_ACT": at}
        server = KukaVarProxyServer(lambda name, told=told: told.get(name, ""))
        device = connected("kukavarproxy", host="127.0.0.1", port=server.port)
        try:
            with pytest.raises(InputError, match=r"a frame in \$POS_ACT"):
                device.read()
        finally:
            device.close()
            server.stop()


def exposure() -> tuple[bytes, str, float]:
    image = np.random.default_rng(3).integers(0, 255, (48, 64), dtype=np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes(), "image/jpeg", 7.25


@pytest.mark.parametrize(
    "connect",
    [
        lambda url: connected("image-stream", url=url),
        lambda url: connected("opencv", camera=url),
    ],
)
def test_a_cameras_stream_is_read(connect: Callable[[str], Device]) -> None:
    server = StreamServer(exposure)
    try:
        device = connect(server.url)
        frames = [device.read() for _ in range(3)]
        device.close()
    finally:
        server.stop()
    for frame in frames:
        assert isinstance(frame, Frame)
        image = cv2.imdecode(np.frombuffer(frame.content, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert image.shape == (48, 64)
    if frames[0] is not None and frames[0].name.endswith(".jpg"):
        assert frames[0].content == exposure()[0]
        assert frames[0].device_time_s == 7.25


def test_a_camera_that_is_not_there_says_so() -> None:
    with pytest.raises(ConnectionError, match="no camera"):
        connected("opencv", camera="/dev/none")
