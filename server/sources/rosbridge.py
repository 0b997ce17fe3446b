"""ROS 2 (and 1) over rosbridge: the flange by tf, by a topic of poses, or by joint states and a named arm."""

import json
from typing import Any, cast

from pydantic import Field

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import flange_by_joints
from server.sources.source import Settings, Source

_WAIT_S = 0.5
_LARGEST = 1024 * 1024
_DEG = 57.29577951308232
_MOST_LINKS = 50
_TYPES = {"pose": "geometry_msgs/PoseStamped", "joints": "sensor_msgs/JointState", "tf": "tf2_msgs/TFMessage"}


class RosbridgeSettings(Settings):
    """The bridge, and what tells the flange, in this order: `pose_topic`; a named `arm` by its joints; else tf.

    The table is a joint of the joint states, or the turn about z of `table_frame` in tf.
    """

    url: str = Field(pattern=r"^wss?://\S+$", max_length=500, examples=["ws://192.168.0.5:9090"])
    pose_topic: str | None = Field(default=None, max_length=200, description="Of geometry_msgs/PoseStamped.")
    joints_topic: str = Field(default="/joint_states", max_length=200)
    joints: list[str] = Field(default=[], max_length=12, description="The arm's joints in their order.")
    arm: str | None = Field(default=None, max_length=64, description="A named arm: the flange by its joints.")
    base_frame: str = Field(
        default="base", max_length=200, description="In tf; a UR's base_link is half a turn off."
    )
    flange_frame: str = Field(default="tool0", max_length=200, description="In tf.")
    table_joint: str | None = Field(default=None, max_length=200)


class TfChain:
    """The flange in the base by the links that tf tells.

    The oldest stamp of the links between both counts: others publish there, too, and a link that nobody renews
    leaves the flange where it was.
    """

    def __init__(self, base_frame: str, flange_frame: str) -> None:
        self._base, self._flange = base_frame, flange_frame
        self._links: dict[str, tuple[str, RigidTransform]] = {}
        self._stamps_s: dict[str, float] = {}  # of links that are told again and again

    def hear(self, transforms: list[dict[str, Any]], *, is_static: bool) -> tuple[RigidTransform, float] | None:
        """Take a message's links; return base_from_tool0 and its stamp where they tell something of it."""
        told: set[str] = set()
        for one in transforms:
            placed = _transform(one["transform"]["translation"], one["transform"]["rotation"])
            child = one["child_frame_id"].lstrip("/")
            told.add(child)
            self._links[child] = one["header"]["frame_id"].lstrip("/"), placed
            if not is_static:
                self._stamps_s[child] = _seconds(one["header"])
        flange, links = self._chain()
        if flange is None or not told & links:
            return None
        return flange, min((self._stamps_s[link] for link in links if link in self._stamps_s), default=0.0)

    def _chain(self) -> tuple[RigidTransform | None, set[str]]:
        """Return base_from_tool0, None where a link is not there yet, and the links' children."""
        frame, found = self._flange, None
        links: set[str] = set()
        for _ in range(_MOST_LINKS):
            if frame == self._base and found is not None:
                return RigidTransform.from_rounded(found.tolist(), "base", "tool0"), links
            if frame not in self._links:
                return None, links
            links.add(frame)
            frame, link = self._links[frame]
            found = link.matrix if found is None else link.matrix @ found
        return None, links


class Rosbridge:
    """Subscribes to what is needed; the stamp of a message's header is the device's time."""

    def __init__(self, settings: RosbridgeSettings) -> None:
        from websockets.sync.client import connect

        self._settings = settings
        self._tf = TfChain(settings.base_frame, settings.flange_frame)
        self._table_deg: float | None = None
        self._joints_deg: tuple[float, ...] | None = None
        self._joints_s: float | None = None
        # A message that was not asked for, or is too large, ends the connection.
        self._bridge: Any = connect(settings.url, open_timeout=2, close_timeout=1, max_size=_LARGEST, proxy=None)
        self._by_tf = not settings.pose_topic and not settings.arm
        topics = (
            {settings.joints_topic: "joints"} if settings.joints or settings.table_joint or settings.arm else {}
        )
        topics |= {settings.pose_topic: "pose"} if settings.pose_topic else {}
        topics |= {"/tf": "tf", "/tf_static": "tf"} if self._by_tf else {}
        self._topics = topics
        for topic, kind in topics.items():
            self._bridge.send(json.dumps({"op": "subscribe", "topic": topic, "type": _TYPES[kind]}))

    def describe(self) -> Description:
        """Return what is subscribed to."""
        kinds = set(self._topics.values())
        can = ("pose", "device time", *(("joints",) if self._settings.joints else ()))
        can += ("table",) if self._settings.table_joint else ()
        frames = (
            f"{self._settings.flange_frame} in {self._settings.base_frame}" if "tf" in kinds else "flange in base"
        )
        return Description("ROS by rosbridge", "m, rad", "ros", frames, can)

    def read(self) -> Sample | None:
        """Return the next message as a sample; raises OSError, InputError."""
        from websockets.exceptions import ConnectionClosed

        try:
            heard = json.loads(self._bridge.recv(_WAIT_S))
        except TimeoutError:
            return None
        except ConnectionClosed as error:
            raise ConnectionError(message("the bridge closed the connection ({error})", error=error)) from None
        except ValueError:
            raise InputError("JSON from the bridge", "something else", "Check the address.", "url") from None
        if not isinstance(heard, dict):
            raise InputError("an operation of rosbridge", "something else", "Check the address.", "url")
        told = cast("dict[str, Any]", heard)
        if told.get("op") == "status" and told.get("level") == "error":
            raise InputError("a subscription", str(told.get("msg"))[:200], "Check topics and types.", "topic")
        kind = self._topics.get(str(told.get("topic")))
        if told.get("op") != "publish" or kind is None:
            return None
        try:
            return self._heard(kind, told["msg"], is_static=told["topic"] == "/tf_static")
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            got = message("one without {error}", error=error)
            to_do = "Check the topic's type."
            raise InputError("a message of {types}", got, to_do, kind, types=_TYPES[kind]) from None

    def _heard(self, kind: str, message: dict[str, Any], *, is_static: bool) -> Sample | None:
        if kind == "pose":
            pose = message["pose"]
            placed = _transform(pose["position"], pose["orientation"])
            return self._sample(placed, _seconds(message["header"]))
        if kind == "joints":
            return self._joints(message)
        found = self._tf.hear(message["transforms"], is_static=is_static)
        return None if found is None else self._sample(*found)

    def _joints(self, message: dict[str, Any]) -> Sample | None:
        values = dict(zip(message["name"], message["position"], strict=True))
        chosen = self._settings
        if {chosen.table_joint, *chosen.joints} & set(values):
            self._joints_s = _seconds(message["header"]) or None
        if chosen.table_joint in values:
            self._table_deg = float(values[chosen.table_joint]) * _DEG
        if chosen.joints and set(chosen.joints) <= set(values):
            self._joints_deg = tuple(float(values[name]) * _DEG for name in chosen.joints)
            if chosen.arm:
                return self._sample(flange_by_joints(chosen.arm, self._joints_deg), _seconds(message["header"]))
        return None

    def _sample(self, pose: RigidTransform, stamp_s: float) -> Sample:
        """Return a sample as old as its oldest part: joints and table may stand still while the pose goes on."""
        oldest_s = stamp_s if self._joints_s is None else min(stamp_s, self._joints_s)
        return Sample(host_now_s(), oldest_s or None, pose, self._joints_deg, self._table_deg)

    def close(self) -> None:
        """Close the connection."""
        self._bridge.close()


def _seconds(header: dict[str, Any]) -> float:
    stamp = header["stamp"]
    return float(stamp.get("sec", stamp.get("secs", 0))) + 1e-9 * float(
        stamp.get("nanosec", stamp.get("nsecs", 0))
    )


def _transform(place: dict[str, Any], turn: dict[str, Any]) -> RigidTransform:
    return parse_pose("ros", [float(place[k]) for k in "xyz"] + [float(turn[k]) for k in "xyzw"])


SOURCE = Source(
    "rosbridge",
    "ROS: rosbridge",
    "Subscribes to poses, joint states or tf of ROS 2 over a websocket bridge.",
    RosbridgeSettings,
    connect=Rosbridge,
    delivers=("robot", "table"),
    clock="every-reading",
)
