"""ROS: poses and transforms as YAML, from tf2_echo, in recordings; frames of URDF, launch files, MoveIt."""

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.exports.export import export
from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose, to_pose
from calib_core.robots.backup import read_controller_files
from calib_core.robots.controller_file import ControllerFile
from calib_core.robots.file_hints import Told
from tests.core.test_robot_exports import SESSION, TABLE, TOOL, results

POSE = """header:
  stamp:
    sec: 12
    nanosec: 500000000
  frame_id: base
pose:
  position:
    x: 0.5
    y: -0.1
    z: 0.2
  orientation:
    x: 0.0
    y: 0.0
    z: 0.7071067811865476
    w: 0.7071067811865476
---
"""


def read(text: str, name: str = "a.yaml", **told: str) -> ControllerFile:
    return read_controller_files({name: text.encode()}, None, False, Told.of(told))


def reasons(found: ControllerFile) -> str:
    return " ".join(f"{row.line}: {row.reason}" for row in found.skipped)


def test_pose_stamped_as_yaml() -> None:
    found = read(POSE * 2)
    assert [pose.line for pose in found.poses] == [7, 23]
    one = found.poses[0]
    assert one.pose == (0.5, -0.1, 0.2, 0, 0, 0.7071067811865476, 0.7071067811865476)
    assert (one.frame, one.tool, one.time_s) == ("base", None, 12.5)
    assert "which tool" in one.doubt
    assert "half a turn" not in one.doubt
    assert "half a turn" in read(POSE.replace("frame_id: base", "frame_id: base_link")).poses[0].doubt


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("frame_id: base", "frame_id: camera_link", "camera_link, which the file does not define"),
        ("x: 0.5", "x: abc", "'abc' is no number"),
        ("x: 0.5", "x: .nan", "no number"),
        ("    x: 0.5\n", "", "without x"),
        ("w: 0.7071067811865476", "w: 7.07", "unit quaternion"),
        ("x: 0.5", "x: 0.5\n    x: 0.6", "stands twice"),
        ("    z: 0.2", "   z: 0.2", "YAML"),
    ],
)
def test_messages_that_are_not_taken(old: str, new: str, reason: str) -> None:
    whole = POSE.replace("x: 0.5", "x: 0.25")
    found = read(whole + POSE.replace(old, new, 1) + whole)
    assert [pose.pose[0] for pose in found.poses if pose.pose] == [0.25, 0.25]
    assert reason in reasons(found)


def test_a_cut_file_never_gives_a_cut_number() -> None:
    taken = {(0.5, -0.1, 0.2, 0.0, 0.0, 0.7071067811865476, 0.7071067811865476)}
    for end in range(len(POSE)):
        try:
            found = read_controller_files({"a.yaml": POSE[:end].encode()}, "ros")
        except InputError:
            continue
        assert {pose.pose for pose in found.poses} <= taken, POSE[:end]


def test_tf2_echo() -> None:
    text = """At time 1700.5
- Translation: [0.500, 0.100, 0.300]
- Rotation: in Quaternion (xyzw) [0.000, 0.000, 0.000, 1.000]
- Rotation: in RPY (radian) [0.000, -0.000, 0.000]
At time 1701.5
- Translation: [0.500, 0.100, 0.300]
- Rotation: in Quaternion [0.000, 0.000, 0.000, 1.000]
At time 1702.5
- Translation: [0.500, 0.100, 0.4
- Rotation: in Quaternion [0.000, 0.000, 0.000, 1.000]
"""
    found = read(text, "echo.txt")
    assert [(pose.pose, pose.time_s) for pose in found.poses] == [((0.5, 0.1, 0.3, 0, 0, 0, 1), 1700.5)]
    assert "9: " in reasons(found)


def test_transforms_as_yaml_lead_from_the_base_to_the_flange() -> None:
    text = """transforms:
- header: {stamp: {sec: 3, nanosec: 0}, frame_id: base}
  child_frame_id: link_6
  transform:
    translation: {x: 1.0, y: 0.0, z: 0.5}
    rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}
- header: {frame_id: /link_6}
  child_frame_id: tool0
  transform: {translation: {x: 0, y: 0, z: 0.1}, rotation: {x: 0, y: 0, z: 0, w: 1}}
"""
    assert [pose.pose for pose in read(text).poses] == [(1.0, 0.0, 0.6, 0, 0, 0, 1)]
    other = read(text.replace("tool0", "hand"))
    assert other.poses == ()
    assert read(text.replace("tool0", "hand"), flange="hand").poses[0].pose == (1.0, 0.0, 0.6, 0, 0, 0, 1)


UR = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint"] + [f"wrist_{k}_joint" for k in (1, 2, 3)]
NAMES = {"ros2-yaml": "a.yaml", "moveit": "a.yaml", "urdf": "a.xacro", "ros2-launch": "a.launch.py",
         "opencv": "a.yaml", "csv": "a.csv"}  # fmt: skip


@pytest.mark.parametrize("name", sorted(NAMES))
def test_an_export_of_no_brand_is_read_back(name: str) -> None:
    found = read_controller_files({NAMES[name]: export(SESSION, results(), name)[0]})
    tools, frames = {t.number: t for t in found.tools}, {f.number: f for f in found.frames}
    for frame, expected in ((tools["laser"], TOOL), (frames["turntable"], TABLE)):
        pose = parse_pose(frame.convention, frame.pose)
        np.testing.assert_allclose(pose.translation_mm, expected.translation_mm, atol=1e-9, rtol=0)
        np.testing.assert_allclose(pose.rotation, expected.rotation, atol=1e-12, rtol=0)


def test_what_a_launch_file_calculates_is_said() -> None:
    text = export(SESSION, results(), "ros2-launch")[0].decode().replace("'--y', '-", "'--y', 'LaunchY-")
    assert "no value in the file" in reasons(read(text, "a.launch.py"))
    urdf = '<robot><joint name="j" type="fixed">'
    urdf += '<parent link="tool0"/><child link="c"/><origin xyz="${x} 0 0"/></joint></robot>'
    assert "no value in the file" in reasons(read(urdf, "a.urdf"))


class Recording:
    """Writes recordings by the library's own writer, with the definitions of ROS 2 Humble."""

    def __init__(self, folder: Path, plugin: str) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._types: Any = self._store.types
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin[plugin])
        self._topics: dict[str, Any] = {}
        self._writer.open()

    def close(self) -> None:
        self._writer.close()

    def put(self, topic: str, kind: str, time_s: float, message: Any) -> None:
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(self._topics[topic], int(time_s * 1e9), self._store.serialize_cdr(message, kind))

    def header(self, time_s: float, frame: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](int(time_s), round((time_s % 1) * 1e9))
        return self._types["std_msgs/msg/Header"](stamp, frame)

    def transforms(self, topic: str, time_s: float, *edges: tuple[str, str, Sequence[float]]) -> None:
        of = self._types
        rows = [
            of["geometry_msgs/msg/TransformStamped"](
                self.header(time_s, parent), child,
                of["geometry_msgs/msg/Transform"](
                    of["geometry_msgs/msg/Vector3"](*n[:3]), of["geometry_msgs/msg/Quaternion"](*n[3:])),
            )
            for parent, child, n in edges
        ]  # fmt: skip
        self.put(topic, "tf2_msgs/msg/TFMessage", time_s, of["tf2_msgs/msg/TFMessage"](rows))

    def joints(self, time_s: float, names: list[str], values: list[float]) -> None:
        empty = np.array([])
        kind = "sensor_msgs/msg/JointState"
        message = self._types[kind](self.header(time_s, ""), names, np.array(values), empty, empty)
        self.put("/joint_states", kind, time_s, message)


@pytest.fixture(params=["MCAP", "SQLITE3"])
def recording(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, bytes]:
    """An arm that moves in two joints, recorded in base_link; the controller's base is turned by half a turn."""
    made = Recording(tmp_path / "bag", request.param)
    static = [("base_link", "base", [0, 0, 0, 0, 0, 1, 0]), ("link_6", "tool0", [0, 0, 0.1, 0, 0, 0, 1]),
              ("tool0", "camera", [0, 0.05, 0, 0, 0, 0, 1])]  # fmt: skip
    made.transforms("/tf_static", 0.0, *static)
    for k in range(4):
        at = 10.0 + k
        made.joints(at, UR, [0.3, 0.2, 0.1 * k, 0.4, 0.5, 0.6])  # fmt: skip
        made.transforms("/tf", at, ("base_link", "link_6", [1.0, 0.1 * min(k, 2), 0.5, 0, 0, 0, 1]))
    made.close()
    file = next(f for f in (tmp_path / "bag").iterdir() if f.suffix in (".mcap", ".db3"))
    return file.name, file.read_bytes()


def test_a_recording(recording: tuple[str, bytes]) -> None:
    name, data = recording
    found = read_controller_files({name: data})
    assert found.brand == "ros"
    places = [parse_pose("ros", pose.pose or ()).translation_mm.tolist() for pose in found.poses]
    np.testing.assert_allclose(places, [[-1000, -100 * k, 600] for k in range(3)], atol=1e-9)
    assert [(pose.frame, pose.tool, pose.time_s, pose.doubt) for pose in found.poses] == [
        ("base", "tool0", 10.0 + k, "") for k in range(3)
    ]
    # A JointState lists its joints by the alphabet; an arm's first joint is the shoulder's pan.
    np.testing.assert_allclose(found.poses[1].joints_deg or (), np.degrees([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
    assert [(tool.number, tool.pose[1]) for tool in found.tools] == [("camera", 0.05)]
    own = read_controller_files({name: data}, None, False, Told.of({"base": "base_link"}))
    assert (own.poses[0].pose or ())[0] == pytest.approx(1.0)


def test_a_damaged_recording_is_told_or_right(recording: tuple[str, bytes]) -> None:
    name, data = recording
    whole = {pose.pose for pose in read_controller_files({name: data}).poses}
    chance = random.Random(4)
    for _ in range(60):
        cut = data[: chance.randrange(len(data))]
        try:
            found = read_controller_files({name: cut}, "ros")
        except InputError:
            continue
        assert {pose.pose for pose in found.poses} <= whole


def test_a_recording_without_poses_says_what_is_there(tmp_path: Path) -> None:
    made = Recording(tmp_path / "bag", "MCAP")
    made.put("/chatter", "std_msgs/msg/String", 0.0, made._types["std_msgs/msg/String"]("hello"))
    made.close()
    file = next((tmp_path / "bag").glob("*.mcap"))
    with pytest.raises(InputError, match=r"/chatter \(std_msgs/msg/String\)"):
        read_controller_files({file.name: file.read_bytes()})


def test_random_poses_round_trip() -> None:
    chance = np.random.default_rng(7)
    for _ in range(50):
        pose = RigidTransform.of(chance.uniform(-3, 3, 3), chance.uniform(-2000, 2000, 3), "base", "tool0")
        x, y, z, qx, qy, qz, qw = map(repr, to_pose("ros", pose))
        turned = f"{{x: {qx}, y: {qy}, z: {qz}, w: {qw}}}"
        text = f"pose:\n  position: {{x: {x}, y: {y}, z: {z}}}\n  orientation: {turned}\n"
        again = parse_pose("ros", read(text).poses[0].pose or ())
        np.testing.assert_allclose(again.matrix, pose.matrix, atol=1e-9)
