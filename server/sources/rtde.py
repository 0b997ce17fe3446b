"""Universal Robots: the Real-Time Data Exchange on port 30004, protocol version 2, outputs alone."""

import struct

from pydantic import Field

from calib_core.errors import InputError
from calib_core.messages import message, plural
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Host, Port
from server.sources.source import Settings, Source
from server.sources.tcp_stream import TcpStream

VERSION, SETUP_OUTPUTS, START, DATA, TEXT = 86, 79, 83, 85, 77
_NUMBERS = {"DOUBLE": 1, "VECTOR6D": 6}
_WANTED = ("timestamp", "actual_q", "actual_TCP_pose", "actual_TCP_speed")
_OFFSET = "tcp_offset"
_WAIT_S = 1.0
_LEAST_SPEED = 1e-4
_DEG = 57.29577951308232


class RtdeSettings(Settings):
    """The controller, and how often it sends."""

    host: Host
    port: Port = 30004
    frequency_hz: float = Field(default=50.0, ge=1.0, le=500.0)


class Rtde:
    """Receives what the controller sends.

    The flange is the tool's pose without the tool's offset.  Controllers that do not tell the offset must have the
    flange as their active tool.
    """

    def __init__(self, settings: RtdeSettings) -> None:
        self._stream = TcpStream(settings.host, settings.port, _WAIT_S)
        try:
            if self._ask(VERSION, struct.pack(">H", 2)) != b"\x01":
                raise ConnectionError(message("the controller does not speak version 2 of RTDE"))
            self._names, self._types = self._outputs(settings.frequency_hz, (*_WANTED, _OFFSET))
            if self._ask(START, b"") != b"\x01":
                raise ConnectionError(message("the controller does not start to send"))
        except BaseException:
            self._stream.close()
            raise

    def describe(self) -> Description:
        """Return what the controller sends."""
        can = ("pose", "joints", "moving", "device time")
        return Description("Universal Robots RTDE", "m, rad", "ur", "flange in base", can)

    def read(self) -> Sample | None:
        """Return the next package as a sample; raises OSError where none comes within a second."""
        kind, payload = self._package()
        if kind != DATA:
            return None
        counts = [_NUMBERS[type_] for type_ in self._types]
        if len(payload) != 1 + 8 * sum(counts):
            need = "a package as it was agreed"
            to_do = "Restart the controller's RTDE."
            raise InputError(need, plural("{count} byte", "{count} bytes", by="count", count=len(payload)), to_do)
        numbers = struct.unpack(f">{sum(counts)}d", payload[1:])
        told: dict[str, tuple[float, ...]] = {}
        at = 0
        for name, count in zip(self._names, counts, strict=True):
            told[name] = numbers[at : at + count]
            at += count
        pose = parse_pose("ur", list(told["actual_TCP_pose"]))
        if _OFFSET in told:
            offset = parse_pose("ur", list(told[_OFFSET]))
            pose = pose @ type(pose)(offset.matrix, "tool0", "tool0").inverse()
        return Sample(
            host_now_s(),
            told["timestamp"][0],
            pose,
            tuple(q * _DEG for q in told["actual_q"]),
            moving=max(map(abs, told["actual_TCP_speed"])) > _LEAST_SPEED,
        )

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()

    def _outputs(self, frequency_hz: float, names: tuple[str, ...]) -> tuple[tuple[str, ...], list[str]]:
        """Return the outputs that the controller agrees to send, and their types."""
        answer = self._ask(SETUP_OUTPUTS, struct.pack(">d", frequency_hz) + ",".join(names).encode())
        types = answer[1:].decode("ascii", errors="replace").strip(",").split(",")
        if len(types) == len(names) and types[-1] == "NOT_FOUND" and names[-1] == _OFFSET:
            return self._outputs(frequency_hz, _WANTED)
        if len(types) != len(names) or not set(types) <= set(_NUMBERS):
            raise ConnectionError(
                message(
                    "the controller does not tell {names} ({types})",
                    names=", ".join(names),
                    types=", ".join(types),
                )
            )
        return names, types

    def _ask(self, kind: int, payload: bytes) -> bytes:
        self._stream.send(struct.pack(">HB", 3 + len(payload), kind) + payload)
        while True:
            answered, content = self._package()
            if answered == kind:
                return content

    def _package(self) -> tuple[int, bytes]:
        size, kind = struct.unpack(">HB", self._stream.exactly(3))
        if size < 3:
            raise ConnectionError(message("the controller sends something else than RTDE"))
        return kind, self._stream.exactly(size - 3)


SOURCE = Source(
    "ur-rtde",
    "Universal Robots: RTDE",
    "Receives the flange's pose, joints and speed from a controller of Universal Robots.",
    RtdeSettings,
    connect=Rtde,
    delivers=("robot",),
    clock="every-reading",
)
