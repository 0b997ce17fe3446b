"""KUKA: variables over KUKAVARPROXY or C3 Bridge on port 7000."""

import re
import struct

from pydantic import Field

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Host, Interval, Pace, Port
from server.sources.source import Settings, Source
from server.sources.tcp_stream import TcpStream

_READ = 0
_WAIT_S = 1.0
_NAMES = ("$POS_ACT", "$TOOL", "$BASE", "$AXIS_ACT", "$ROB_STOPPED", "$ACT_TOOL", "$ACT_BASE")
_FRAME, _AXES = "X Y Z A B C", "A1 A2 A3 A4 A5 A6"
_FIELD = r"\s*[A-Z]\d?\s+(?:[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?|'B[01]+')\s*"
_STRUCTURE = re.compile(rf"\s*\{{(?:\s*\w+\s*:)?({_FIELD}(?:,{_FIELD})*)\}}\s*")


class KukaVarProxySettings(Settings):
    """The controller; `table_axis` is the external axis that turns the table."""

    host: Host
    port: Port = 7000
    table_axis: str | None = Field(default=None, pattern=r"^E[1-6]$")
    interval_s: Interval = 0.05


class KukaVarProxy:
    """Asks for the variables one after the other; whether the robot stands is asked after its pose."""

    def __init__(self, settings: KukaVarProxySettings) -> None:
        self._settings, self._pace = settings, Pace(settings.interval_s)
        self._stream = TcpStream(settings.host, settings.port, _WAIT_S)
        self._number = 0

    def describe(self) -> Description:
        """Return what is asked for."""
        can = ("pose", "joints", "moving", *(("table",) if self._settings.table_axis else ()))
        return Description("KUKAVARPROXY", "mm, degrees", "kuka", "flange in $ROBROOT's base", can)

    def read(self) -> Sample | None:
        """Return where the flange is: $BASE, then $POS_ACT, then without $TOOL."""
        self._pace.wait()
        told = {name: self.variable(name) for name in _NAMES}
        base, tool, at = (_frame(told[name], name) for name in ("$BASE", "$TOOL", "$POS_ACT"))
        pose = base.matrix @ at.matrix @ tool.inverse().matrix
        axes = _numbers(told["$AXIS_ACT"], "$AXIS_ACT")
        axis = self._settings.table_axis
        return Sample(
            host_now_s(),
            None,
            RigidTransform.from_rounded(pose.tolist(), "base", "tool0"),
            tuple(axes[name] for name in _AXES.split() if name in axes) or None,
            axes.get(axis) if axis else None,
            told["$ROB_STOPPED"].strip().upper() != "TRUE",
            int(told["$ACT_TOOL"]) if told["$ACT_TOOL"].strip().isdigit() else None,
            int(told["$ACT_BASE"]) if told["$ACT_BASE"].strip().isdigit() else None,
        )

    def variable(self, name: str) -> str:
        """Return a variable's value as the controller writes it; raises OSError."""
        self._number = self._number % 60_000 + 1
        text = name.encode("ascii")
        body = struct.pack(">BH", _READ, len(text)) + text
        self._stream.send(struct.pack(">HH", self._number, len(body)) + body)
        number, size = struct.unpack(">HH", self._stream.exactly(4))
        answer = self._stream.exactly(size)
        if number != self._number or size < 3:
            raise ConnectionError(message("the answer is to another question"))
        (length,) = struct.unpack(">H", answer[1:3])
        if length > size - 3:
            raise ConnectionError(message("the answer is shorter than it says"))
        return answer[3 : 3 + length].decode("latin-1")

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()


def _numbers(text: str, name: str, wanted: str = "") -> dict[str, float]:
    """Return the numbers of a structure such as ``{E6POS: X 1.0, Y 2.0, …}``, that must be whole.

    Raises
    ------
    InputError
        If anything in it is not what a controller writes: a gateway that loses bytes would tell another place.
    """
    whole = _STRUCTURE.fullmatch(text)
    fields = dict(part.split() for part in whole[1].split(",")) if whole else {}
    if not set(wanted.split()) <= set(fields):
        raise InputError("a frame in {name}", repr(text[:60]), "Check that the program runs.", name, name=name)
    return {key: float(value) for key, value in fields.items() if not value.startswith("'")}


def _frame(text: str, name: str) -> RigidTransform:
    numbers = _numbers(text, name, _FRAME)
    return parse_pose("kuka", [numbers[letter] for letter in _FRAME.split()])


SOURCE = Source(
    "kukavarproxy",
    "KUKA: variables",
    "Reads the flange's pose, joints and an external axis over KUKAVARPROXY or C3 Bridge.",
    KukaVarProxySettings,
    connect=KukaVarProxy,
    delivers=("robot", "table"),
)
