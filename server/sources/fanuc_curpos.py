"""FANUC: the position that the controller writes into CURPOS.DG, read over its web server."""

import http.client
import re

from pydantic import Field

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Host, Interval, Pace, Port, ToolAndFrame, flange_by_joints, flange_of
from server.sources.source import Source

_PATH = "/MD/CURPOS.DG"
_MOST_BYTES = 256 * 1024
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+))[ \t]*\r?\n"  # a number counts with its line's end: else it may be cut


class FanucCurposSettings(ToolAndFrame):
    """The controller, and which motion group the robot is; `tool` is the active one, UTOOL 0 being the flange.

    The table is joint 1 of `table_group`, or the extended axis `table_axis` of the robot's own group.
    """

    host: Host
    port: Port = 80
    group: int = Field(default=1, ge=1, le=8)
    table_group: int | None = Field(default=None, ge=1, le=8)
    table_axis: str | None = Field(default=None, pattern=r"^E[1-6]$")
    interval_s: Interval = 0.05


class FanucCurpos:
    """Asks for the file again and again; about 50 ms each on a controller, two decimals of a mm and degree."""

    def __init__(self, settings: FanucCurposSettings) -> None:
        self._settings, self._pace = settings, Pace(settings.interval_s)
        self._connection = http.client.HTTPConnection(settings.host, settings.port, timeout=1.5)
        self._connection.connect()

    def describe(self) -> Description:
        """Return what the file tells."""
        has_table = self._settings.table_group or self._settings.table_axis
        can = ("pose", "joints", *(("table",) if has_table else ()))
        return Description("FANUC CURPOS.DG", "mm, degrees", "fanuc", "active tool in world", can)

    def read(self) -> Sample | None:
        """Return where the flange is; raises OSError, InputError."""
        self._pace.wait()
        try:
            self._connection.request("GET", _PATH)
            answer = self._connection.getresponse()
            content = answer.read(_MOST_BYTES)
        except http.client.HTTPException as error:
            raise ConnectionError(message("the controller's answer breaks off ({error!r})", error=error)) from None
        if answer.length:
            raise ConnectionError(message("the controller's answer breaks off"))
        if answer.status != 200:
            to_do = "Unlock it in the controller's HTTP."
            raise InputError("the file {name}", "the answer {status}", to_do, name=_PATH, status=answer.status)
        return self._sample(content.decode("latin-1"))

    def _sample(self, text: str) -> Sample:
        chosen = self._settings
        groups = parse_curpos(text)
        if chosen.group not in groups:
            got = message("groups {groups}", groups=", ".join(map(str, groups)) or "none")
            need = "motion group {group} in {path}"
            raise InputError(need, got, "Name another group or axis.", "group", group=chosen.group, path=_PATH)
        told = groups[chosen.group]
        tool = int(told["tool"][0]) if told["tool"] else None
        joints = told["joints"]
        if chosen.arm:
            pose = flange_by_joints(chosen.arm, joints)
        else:
            if len(told["world"]) != 6:
                raise InputError("the world position", "none that is calibrated", "Master the robot.", "world")
            if tool not in (None, 0) and not chosen.tool:
                to_do = message("Give its X Y Z W P R in the source's settings, or activate UTOOL 0.")
                need = "the flange: UTOOL 0"
                raise InputError(need, "UTOOL {tool}, whose place is not known", to_do, "tool", tool=tool)
            pose = flange_of(chosen, "fanuc", parse_pose("fanuc", list(told["world"])))
        return Sample(host_now_s(), None, pose, joints or None, self._table(groups), None, tool)

    def _table(self, groups: dict[int, dict[str, tuple[float, ...]]]) -> float | None:
        chosen = self._settings
        if chosen.table_group is not None:
            values, place = groups.get(chosen.table_group, {}).get("joints", ()), 0
        elif chosen.table_axis is not None:
            values, place = groups[chosen.group]["extended"], int(chosen.table_axis[1:]) - 1
        else:
            return None
        if place >= len(values):
            raise InputError("the table's axis", "none", "Name another group or axis.", "table_axis")
        return values[place]

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def parse_curpos(text: str) -> dict[int, dict[str, tuple[float, ...]]]:
    """Return by motion group its `joints`, `extended` axes, the `world` position (six numbers) and the `tool`."""
    plain = re.sub(r"<[^>]*>", " ", text)
    groups: dict[int, dict[str, tuple[float, ...]]] = {}
    for part in re.split(r"Group\s*#:", plain)[1:]:
        number = re.match(r"\s*(\d+)", part)
        if number is None:
            continue
        before, _, world = part.partition("CURRENT WORLD POSITION")
        place = dict(re.findall(rf"^\s*([XYZWPR]):\s*{_NUMBER}", world, re.MULTILINE))
        tools = re.findall(r"Tool\s*#:\s*(\d+)", before)
        extended = re.search(r"EXTAXS:(.*)", before, re.DOTALL)
        groups[int(number.group(1))] = {
            "joints": _floats(re.findall(rf"Joint\s+\d+:\s*{_NUMBER}", before)),
            "extended": _floats(re.findall(rf"^\s*\d:\s*{_NUMBER}", extended.group(1), re.MULTILINE))
            if extended
            else (),
            "world": _floats([place[letter] for letter in "XYZWPR"]) if len(place) == 6 else (),
            "tool": _floats(tools[-1:]),
        }
    return groups


def _floats(texts: list[str]) -> tuple[float, ...]:
    return tuple(map(float, texts))


SOURCE = Source(
    "fanuc-curpos",
    "FANUC: CURPOS",
    "Asks a controller of FANUC for its position over HTTP; no option of the controller is needed.",
    FanucCurposSettings,
    connect=FanucCurpos,
    delivers=("robot", "table"),
)
