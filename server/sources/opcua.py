"""OPC UA: robot, table or both, by the ids of their nodes.

OPC UA for Robotics tells axes and no flange: where no pose is offered, joints and a named arm give it.
"""

from typing import Any, Literal

from pydantic import Field, SecretStr

from calib_core.errors import InputError
from calib_core.records.base import PoseConvention
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Interval, Pace, flange_by_joints
from server.sources.source import Settings, Source

_DEG = {"deg": 1.0, "rad": 57.29577951308232}


class OpcUaSettings(Settings):
    """The server, and which nodes tell what; at least the pose, the joints or the table.

    `pose` is one node that holds all numbers or one node a number, as `convention` has them; `joints` likewise.
    """

    url: str = Field(pattern=r"^opc\.tcp://\S+$", max_length=500, examples=["opc.tcp://192.168.0.20:4840"])
    user: str | None = Field(default=None, max_length=200)
    password: SecretStr | None = None
    pose: list[str] = Field(default=[], max_length=16)
    convention: PoseConvention = "quaternion-xyzw"
    joints: list[str] = Field(default=[], max_length=12)
    joints_unit: Literal["deg", "rad"] = "deg"
    arm: str | None = Field(default=None, description="A named arm, where joints alone are told.")
    table: str | None = None
    table_unit: Literal["deg", "rad"] = "deg"
    moving: str | None = None
    active_tool: str | None = None
    active_frame: str | None = None
    interval_s: Interval = 0.02


class OpcUa:
    """Reads all nodes in one request, again and again; a value's source time is the sample's device time."""

    def __init__(self, settings: OpcUaSettings) -> None:
        from asyncua.sync import Client

        self._settings, self._pace = settings, Pace(settings.interval_s)
        named = {"pose": settings.pose, "joints": settings.joints}
        singles = ("table", "moving", "active_tool", "active_frame")
        named |= {name: [node] for name in singles if (node := getattr(settings, name))}
        self._places = [(name, node) for name, nodes in named.items() for node in nodes]
        if not any(name in ("pose", "joints", "table") for name, _ in self._places):
            raise InputError("nodes of a pose, joints or a table", "none", "Name their ids.", "settings")
        self._client: Any = Client(settings.url, timeout=2)
        if settings.user:
            self._client.set_user(settings.user)
            self._client.set_password(settings.password.get_secret_value() if settings.password else "")
        try:
            self._client.connect()
        except BaseException:
            self._client.tloop.stop()  # else its thread stays
            raise
        self._nodes = [self._client.get_node(node) for _, node in self._places]

    def describe(self) -> Description:
        """Return what the nodes tell."""
        told = {name for name, _ in self._places}
        can = tuple(name for name in ("pose", "joints", "table", "moving") if name in told)
        return Description(self._settings.url, "mm, degrees", self._settings.convention, "flange in base", can)

    def read(self) -> Sample | None:
        """Return the nodes' values as of now; raises InputError where one has none."""
        self._pace.wait()
        found = self._client.read_attributes(self._nodes)
        told: dict[str, list[Any]] = {}
        times: list[float] = []
        for (name, node), value in zip(self._places, found, strict=True):
            if not value.StatusCode.is_good() or value.Value is None or value.Value.Value is None:
                raise InputError("a good value of every node", "none of {node}", "Check its id.", node, node=node)
            numbers = value.Value.Value
            told.setdefault(name, []).extend(numbers if isinstance(numbers, list) else [numbers])
            if name in ("pose", "joints", "table") and value.SourceTimestamp is not None:
                times.append(value.SourceTimestamp.timestamp())
        return self._sample(told, max(times) if times else None)

    def _sample(self, told: dict[str, list[Any]], device_s: float | None) -> Sample:
        chosen = self._settings
        joints = tuple(float(v) * _DEG[chosen.joints_unit] for v in told.get("joints", ())) or None
        pose = None
        if told.get("pose"):
            pose = parse_pose(chosen.convention, [float(v) for v in told["pose"]])
        elif joints and chosen.arm:
            pose = flange_by_joints(chosen.arm, joints)
        table = float(told["table"][0]) * _DEG[chosen.table_unit] if "table" in told else None
        return Sample(
            host_now_s(),
            device_s,
            pose,
            joints,
            table,
            bool(told["moving"][0]) if "moving" in told else None,
            *(told.get(name, [None])[0] for name in ("active_tool", "active_frame")),
        )

    def close(self) -> None:
        """End the session, also where the server is gone."""
        try:
            self._client.disconnect()
        finally:
            if self._client.tloop.is_alive():
                self._client.tloop.stop()


SOURCE = Source(
    "opcua",
    "OPC UA: robot, table",
    "Reads poses, joints and the table's angle from an OPC UA server, by the ids of its nodes.",
    OpcUaSettings,
    connect=OpcUa,
    delivers=("robot", "table"),
    extra="opcua",
    clock="on-change",
)
