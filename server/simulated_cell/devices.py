"""The simulated cell's devices, each over a protocol of real ones: scanner, robot, table."""

import threading
import time
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.robots import to_pose
from calib_core.simulation import simulate
from calib_core.simulation.live_camera import HEIGHT_PX, WIDTH_PX, LiveCamera
from calib_core.simulation.live_cell import LiveCell
from server.simulated_cell.arm import SimulatedArm
from server.simulated_cell.gige_server import GigeServer
from server.simulated_cell.kukavarproxy_server import KukaVarProxyServer
from server.simulated_cell.rtde_server import RtdeServer
from server.simulated_cell.stream_server import StreamServer

if TYPE_CHECKING:
    from server.simulated_cell.opcua_server import OpcUaServer

_SPEED = 0.1  # m/s, told while the robot is on its way


class SimulatedDevices:
    """Scanner by HTTP or GigE Vision, robot by RTDE, KUKA's variables and OPC UA, table by Modbus and OPC UA.

    OPC UA and Modbus are served where their extras are installed.

    Parameters
    ----------
    scenario, seed : str, int
        Of a cell whose scanner sends profiles of the sphere.
    rate_hz : float
        Of exposures.
    scanner_clock_s : float
        What the scanner's clock tells more than the robot's.
    camera : bool
        Serve the scanner's raw camera by GigE Vision beside its profiles, and name it as the scanner.
    """

    def __init__(
        self,
        scenario: str = "turntable",
        seed: int = 1,
        rate_hz: float = 20.0,
        host: str = "127.0.0.1",
        travel_s: float = 0.5,
        scanner_clock_s: float = 0.0,
        camera: bool = False,
    ) -> None:
        self.simulated = simulate(scenario, seed)
        if self.simulated.world is None or set(self.simulated.world.options.kinds) != {"profile"}:
            to_do = message("Name tcp, turntable or one of their variants.")
            raise InputError("a cell whose scanner sends profiles of the sphere", f"'{scenario}'", to_do)
        self.cell = LiveCell(self.simulated, travel_s)
        self._rng = np.random.default_rng([seed, 20_270])
        self.scanner_clock_s = scanner_clock_s
        self._lock = threading.Lock()
        self._arm = SimulatedArm()
        self.scanner = StreamServer(self._exposure, rate_hz, host)
        self.lens = LiveCamera(self._rng) if camera else None
        self.camera = GigeServer(self._image, (WIDTH_PX, HEIGHT_PX), rate_hz, host) if camera else None
        self.robot = RtdeServer(self._outputs, host)
        self.variables = KukaVarProxyServer(self._variable, host)
        self._host = host
        self.modbus = None
        try:
            from server.simulated_cell.modbus_server import ModbusServer

            self.modbus = ModbusServer(self._angle, host, turn=self._turn)
        except ImportError:
            pass

    @cached_property
    def opcua(self) -> "OpcUaServer | None":
        """Robot and table over OPC UA, served from when it is asked for: its start takes seconds."""
        try:
            from server.simulated_cell.opcua_server import OpcUaServer
        except ImportError:
            return None
        return OpcUaServer(self._values, self._host)

    @property
    def record(self) -> dict[str, Any]:
        """The cell's record as `POST …/sessions` takes it; a raw camera is told with its plane of light."""
        cell: dict[str, Any] = self.simulated.session.to_json()["cell"]
        if self.lens is None:
            return cell
        return {**cell, "scanner": {"kind": "frame"}, "known": {**cell.get("known", {}), **self.lens.known()}}

    def go(self, number: int) -> None:
        """Send robot and table to where a capture is taken."""
        self.cell.go(number, time.monotonic())

    def sources(self, host: str = "127.0.0.1") -> Mapping[str, Mapping[str, Any]]:
        """Return the devices as `PUT …/devices/{name}` takes them."""
        found: dict[str, Mapping[str, Any]] = {
            "scanner": _source("image-stream", url=f"http://{host}:{self.scanner.port}/"),
            "robot": _source("ur-rtde", host=host, port=self.robot.port),
        }
        if self.camera is not None:
            found["scanner"] = _source("genicam", address=host, interface=host)
        if self.modbus is not None:
            found["table"] = _source("modbus", host=host, port=self.modbus.port, address=100, moving=10)
        elif self.opcua is not None:
            found["table"] = _source("opcua", url=self.opcua.url, table="ns=2;s=Table")
        return found

    def stop(self) -> None:
        """End all servers."""
        opcua = self.__dict__.get("opcua")  # if it was asked for
        for server in (self.scanner, self.camera, self.robot, self.variables, opcua, self.modbus):
            if server is not None:
                server.stop()

    def _exposure(self) -> tuple[bytes, str, float]:
        with self._lock:
            now_s = time.monotonic()
            return self.cell.profile(now_s, self._rng), "text/csv", now_s + self.scanner_clock_s

    def _image(self, exposure_us: float) -> tuple[NDArray[np.uint8], float]:
        assert self.lens is not None
        with self._lock:
            now_s = time.monotonic()
            image = self.lens.image(self.cell.points(now_s, self._rng), self._rng, exposure_us)
            return image, now_s + self.scanner_clock_s

    def _flange(self, moment_s: float | None = None) -> tuple[RigidTransform, bool, float]:
        moment = self.cell.at(time.monotonic() if moment_s is None else moment_s)
        return RigidTransform(moment.reported, "base", "tool0"), moment.moving, moment.table_deg

    def _outputs(self, moment_s: float) -> Mapping[str, tuple[float, ...]]:
        pose, moving, _ = self._flange(moment_s)
        return {
            "timestamp": (moment_s,),
            "actual_q": self._arm.joints_rad(pose.matrix),
            "actual_TCP_pose": tuple(to_pose("ur", pose)),
            "actual_TCP_speed": (_SPEED if moving else 0.0, *(0.0,) * 5),
        }

    def _variable(self, name: str) -> str:
        pose, moving, table_deg = self._flange()
        numbers = zip("XYZABC", to_pose("kuka", pose), strict=True)
        return {
            "$POS_ACT": "{E6POS: " + ", ".join(f"{letter} {value:.6f}" for letter, value in numbers) + "}",
            "$TOOL": "{FRAME: X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}",
            "$BASE": "{FRAME: X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}",
            "$AXIS_ACT": f"{{E6AXIS: E1 {table_deg:.4f}}}",
            "$ROB_STOPPED": "FALSE" if moving else "TRUE",
            "$ACT_TOOL": "0",
            "$ACT_BASE": "0",
        }.get(name.upper(), "")

    def _values(self) -> Mapping[str, Any]:
        pose, moving, table_deg = self._flange()
        return {"Pose": to_pose("quaternion-xyzw", pose), "Moving": moving, "Table": table_deg}

    def _turn(self, table_deg: float | None) -> None:
        """Go to the capture whose table stands nearest to an angle; a stop lets it come to rest there."""
        shots = self.cell.shots
        if table_deg is not None:
            angles = {k: shot.table.reported_angle for k, shot in enumerate(shots) if shot.table is not None}
            self.go(min(angles, key=lambda k: abs(angles[k] - table_deg)))

    def _angle(self) -> tuple[float, bool]:
        moment = self.cell.at(time.monotonic())
        return moment.table_deg, moment.turning


def _source(name: str, **settings: Any) -> Mapping[str, Any]:
    return {"source": name, "settings": settings}
