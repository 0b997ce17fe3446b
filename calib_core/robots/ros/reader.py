"""ROS: PoseStamped, TransformStamped and TFMessage, as YAML, as tf2_echo prints them, and in recordings."""

import math
import re
from collections.abc import Collection
from typing import Any

from calib_core.errors import InputError
from calib_core.formats.ros_bags import bag_messages, is_bag
from calib_core.formats.shared.number import NUMBER
from calib_core.frames import RigidTransform
from calib_core.messages import explained, message
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.robots.controller_file import Found, Frame, Taught
from calib_core.robots.file_hints import Told
from calib_core.robots.phrases import CUT
from calib_core.robots.ros.frame_files import is_urdf, launch_edges, urdf_edges
from calib_core.robots.ros.joints import in_order
from calib_core.robots.ros.transforms import Tree
from calib_core.robots.ros.yaml_messages import Message, messages
from calib_core.robots.text import Source, source_of

_TYPES = {
    "geometry_msgs/msg/Pose": "pose",
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose",
    "geometry_msgs/msg/TransformStamped": "transform",
    "tf2_msgs/msg/TFMessage": "transform",
    "sensor_msgs/msg/JointState": "joints",
}
_AT = re.compile(rf"^At time ({NUMBER})")
_TRANSLATION = re.compile(r"^- Translation: \[([^\]]*)\]\s*$")
_ROTATION = re.compile(r"^- Rotation: in Quaternion (?:\(xyzw\) )?\[([^\]]*)\]\s*$")
_SAME = 1e-9
_JOINTS_WITHIN_S = 0.02
_MOST_POSES = 20_000


def find(data: bytes, name: str, told: Told, base: Collection[str], flange: Collection[str]) -> Found:
    """Return what stands in a file; transforms become poses where they lead from the base to the flange."""
    found = Found(name)
    recorder = _Recorder(found, told, base, flange)
    if is_bag(data):
        for number, (topic, kind, time_s, message) in enumerate(bag_messages(data, name, _TYPES), start=1):
            recorder.take_message(topic, _TYPES[kind], time_s, message, number)
    else:
        source = source_of(data, name)
        if is_urdf(source.text) or "static_transform_publisher" in source.text:
            read = urdf_edges if is_urdf(source.text) else launch_edges
            for edge in read(source, found):
                recorder.take_static(*edge)
        elif re.search(_TRANSLATION.pattern, source.text, re.MULTILINE):
            _echoed(source, recorder)
        else:
            for message in messages(source, found):
                recorder.take_yaml(message)
    recorder.end()
    return found


class _Recorder:
    """Takes messages in their order; a pose that stands still is one pose."""

    def __init__(self, found: Found, told: Told, base: Collection[str], flange: Collection[str]) -> None:
        self._found, self._told = found, told
        self._tree = Tree(base, flange)
        self._base, self._flange = frozenset(base), frozenset(flange)
        self._last: dict[str, tuple[float, ...]] = {}
        self._joints: tuple[float, tuple[float, ...]] | None = None
        self._topics: dict[str, int] = {}
        self._transforms = 0
        self._static: list[tuple[str, str, tuple[float, ...], int]] = []
        self._unordered: set[str] = set()

    def take_static(self, parent: str, child: str, numbers: tuple[float, ...], line: int) -> None:
        """Take a transform that stands still."""
        self._static.append((parent, child, numbers, line))
        self._edge(parent, child, numbers, line)

    def take_yaml(self, message: Message) -> None:
        """Take a pose, or the transforms of one message."""
        for edge in message.transforms:
            self.take_static(*edge)
        if message.transforms:
            self._way(message.time_s, message.line)
        for frame, numbers, line in message.poses:
            self._pose(f"line {line}", frame, numbers, message.time_s, line)

    def take_message(self, topic: str, kind: str, time_s: float, message: Any, number: int) -> None:
        """Take a message of a recording; `number` stands for the line."""
        if self._told.topic and topic != self._told.topic and not topic.startswith("/tf"):
            return
        if kind == "joints":
            self._take_joints(topic, message, number)
        elif kind == "transform":
            rows = getattr(message, "transforms", None)
            for row in [message] if rows is None else rows:
                t, q = row.transform.translation, row.transform.rotation
                take = self.take_static if topic.endswith("tf_static") else self._edge
                take(row.header.frame_id, row.child_frame_id, (t.x, t.y, t.z, q.x, q.y, q.z, q.w), number)
                time_s = _stamp(row.header) or time_s
            self._way(time_s, number)
        else:
            header = getattr(message, "header", None)
            pose = getattr(message, "pose", message)
            pose = getattr(pose, "pose", pose)
            p, q = pose.position, pose.orientation
            time_s = (_stamp(header) if header else 0.0) or time_s
            self._topics[topic] = self._topics.get(topic, 0) + 1
            frame = header.frame_id if header else None
            numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
            self._pose(f"{topic} {number}", frame or None, numbers, time_s, number, topic)

    def end(self) -> None:
        """Say what is left over."""
        found = self._found
        if len(self._topics) > 1 and not self._told.topic:
            found.notes.append(
                message(
                    "Poses of several topics ({topics}): name the flange's with topic.",
                    topics=", ".join(self._topics),
                )
            )
        self._place_static()
        none_taken = not (found.tools or found.frames)
        if self._transforms and none_taken and not any(pose.name.startswith("tf ") for pose in found.poses):
            frames = ", ".join(self._tree.frames()[:12])
            found.skip(
                1,
                message(
                    "no way from the base to the flange among the frames {frames}: name them with base, flange",
                    frames=frames,
                ),
            )

    def _place_static(self) -> None:
        """Note what hangs on the flange as tools, and what stands in the base beside the arm as frames."""
        arm = self._tree.above(self._flange)
        for parent, child, numbers, line in self._static:
            plain_parent, plain_child = parent.lstrip("/"), child.lstrip("/")
            if plain_child.lower() in self._base | self._flange or plain_child in arm:
                continue
            frame = Frame(plain_child, plain_child, numbers, "ros", line, self._found.file)
            if plain_parent.lower() in self._flange:
                self._found.tools.append(frame)
            elif plain_parent.lower() in self._base:
                self._found.frames.append(frame)

    def echoed(self, numbers: tuple[float, ...], time_s: float | None, line: int) -> None:
        """Take a transform as tf2_echo prints it: the text does not say between which frames."""
        self._pose(f"line {line}", None, numbers, time_s, line, "echo")

    def refuse(self, line: int, text: str) -> None:
        """Note a line that cannot be read."""
        self._found.skip(line, message("'{text}' cannot be read: {cut}", text=text.strip()[:60], cut=CUT))

    def _edge(self, parent: str, child: str, numbers: tuple[float, ...], line: int) -> None:
        try:
            self._tree.put(parent, child, numbers)
            self._transforms += 1
        except ValueError as error:
            self._found.skip(line, explained(f"{child} in {parent}", error))

    def _way(self, time_s: float | None, line: int) -> None:
        way = self._tree.base_from_flange()
        if way is None:
            return
        base, flange, matrix = way
        numbers = tuple(to_pose("ros", RigidTransform.from_rounded(matrix, "base", "tool0")))
        self._pose(f"tf {line}", base, numbers, time_s, line, "tf", flange)

    def _pose(
        self,
        name: str,
        frame: str | None,
        numbers: tuple[float, ...],
        time_s: float | None,
        line: int,
        of: str = "",
        tool: str | None = None,
    ) -> None:
        if not all(map(math.isfinite, numbers)):
            self._found.skip(line, message("{name}: not finite numbers", name=name))
            return
        last = self._last.get(of)
        if of and last is not None and max(abs(a - b) for a, b in zip(last, numbers, strict=True)) < _SAME:
            return
        self._last[of] = numbers
        if len(self._found.poses) >= _MOST_POSES:
            to_do = message("Cut the recording to where the robot stands still, or thin it.")
            raise InputError("at most {most_poses} poses", "more", to_do, self._found.file, most_poses=_MOST_POSES)
        if frame is not None and (from_base := self._tree.from_base(frame.lstrip("/"))) is not None:
            base, matrix = from_base
            placed = RigidTransform(matrix, "base", "base") @ parse_pose("ros", numbers)
            numbers, frame = tuple(to_pose("ros", placed)), base
        joints = None
        if self._joints and time_s is not None and abs(self._joints[0] - time_s) <= _JOINTS_WITHIN_S:
            joints = self._joints[1]
        file = self._found.file
        self._found.poses.append(
            Taught(name, numbers, "ros", line, joints, None, tool, frame, file, time_s=time_s)
        )

    def _take_joints(self, topic: str, message: Any, number: int) -> None:
        try:
            joints = in_order(list(message.name), [float(v) for v in message.position])
        except ValueError as error:
            if topic not in self._unordered:
                self._unordered.add(topic)
                self._found.skip(number, explained(f"{topic}", error))
            return
        self._joints = (_stamp(message.header), joints)


def _stamp(header: Any) -> float:
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def _echoed(source: Source, recorder: _Recorder) -> None:
    """Take what tf2_echo prints: the two frames are those that it was asked for, base first."""
    time_s: float | None = None
    place: tuple[float, ...] | None = None
    for line, text in source.lines():
        if at := _AT.match(text):
            time_s, place = float(at[1]), None
        elif moved := _TRANSLATION.match(text):
            place = _listed(moved[1], 3)
            if place is None:
                recorder.refuse(line, text)
        elif turned := _ROTATION.match(text):
            numbers = _listed(turned[1], 4)
            if place is None or numbers is None:
                recorder.refuse(line, text)
            else:
                recorder.echoed((*place, *numbers), time_s, line)
            place = None
        elif text.startswith(("- Translation", "- Rotation: in Quaternion")):
            recorder.refuse(line, text)


def _listed(text: str, count: int) -> tuple[float, ...] | None:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != count or not all(re.fullmatch(NUMBER, part) for part in parts):
        return None
    return tuple(map(float, parts))
