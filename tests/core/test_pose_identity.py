"""Joints and a known arm say whose poses are: of the flange or of a tool, in the base or in a frame."""

from typing import Any

import numpy as np
import pytest

from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.poses.identity import identity_by_joints
from calib_core.robots import to_pose
from calib_core.robots.backup import read_controller_files
from calib_core.robots.file_hints import Told

CHANCE = np.random.default_rng(7)
JOINTS = [(-90 + CHANCE.uniform(-40, 40, 6)).tolist() for _ in range(8)]
FLANGE = [flange_of_joints(NAMED_ARMS["ur10e"], joints) for joints in JOINTS]
TOOL = RigidTransform.of([0.1, 0.7, -0.2], [12.0, -34.0, 156.0], "tool0", "laser")
FRAME = RigidTransform.of([0.0, 0.1, 1.0], [900.0, 100.0, 250.0], "base", "turntable")
HALF = RigidTransform.of([0.0, 0.0, np.pi], [0.0, 0.0, 0.0], "base", "turntable")


def given(before: RigidTransform | None, after: RigidTransform | None) -> list[RigidTransform]:
    """What a controller gives whose poses are of a tool, in a frame, off by what a calibrated arm is off."""
    chance, poses = np.random.default_rng(8), []
    for pose in FLANGE:
        matrix = (
            pose.matrix
            @ RigidTransform.of(chance.normal(0, 1e-3, 3), chance.normal(0, 0.8, 3), "tool0", "tool0").matrix
        )
        matrix = matrix if before is None else np.linalg.inv(before.matrix) @ matrix
        poses.append(RigidTransform(matrix if after is None else matrix @ after.matrix, "base", "tool0"))
    return poses


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (None, None, "of the flange in the robot's base"),
        (None, TOOL, "not of the flange but of a tool"),
        (HALF, None, "turned by half a turn about z"),
        (HALF, TOOL, "but of a tool"),
        (FRAME, None, "not in the robot's base but in a frame"),
    ],
    ids=["flange", "tool", "base_link", "base_link and tool", "frame"],
)
@pytest.mark.parametrize("swapped", [False, True], ids=["all", "one of another capture"])
def test_whose_the_poses_are(before: Any, after: Any, words: str, swapped: bool) -> None:
    poses = given(before, after)
    if swapped:
        poses[2] = poses[5]
    found = identity_by_joints(poses, FLANGE)
    assert found is not None
    assert words in found.sentence
    assert found.of_flange == (before is None and after is None)
    if after is not None:
        assert found.tool0_from_tool is not None
        np.testing.assert_allclose(found.tool0_from_tool[:3, 3], after.translation_mm, atol=5)
    if before is not None:
        assert found.base_from_frame is not None
        np.testing.assert_allclose(found.base_from_frame[:3, 3], before.translation_mm, atol=25)


def script(after: RigidTransform | None) -> bytes:
    """A script as PolyScope writes it: positions and the joints beside them, and no TCP."""
    lines = ["def a():"]
    for k, (pose, joints) in enumerate(zip(given(None, after), JOINTS, strict=True)):
        place = ", ".join(f"{v:.6f}" for v in to_pose("ur", pose))
        turned = ", ".join(f"{v:.6f}" for v in np.radians(joints))
        lines += [f"  global W{k}_p=p[{place}]", f"  global W{k}_q=[{turned}]"]
    return "\n".join([*lines, "end", ""]).encode()


@pytest.mark.parametrize("after", [None, TOOL], ids=["flange", "tool"])
def test_a_file_with_joints_is_asked_whose_its_poses_are(after: RigidTransform | None) -> None:
    file = {"a.script": script(after)}
    plain = read_controller_files(file)
    assert all("with which tool" in pose.doubt for pose in plain.poses)
    read = read_controller_files(file, told=Told.of({"arm": "ur10e"}))
    assert [pose.pose for pose in read.poses] == [pose.pose for pose in plain.poses]
    assert all(("with which tool" in pose.doubt) == (after is not None) for pose in read.poses)
    (note,) = read.notes
    assert ("give the poses of the flange" in note) == (after is None)
    assert ("of a tool on it at x 12" in note or "of a tool on it at x 13" in note) == (after is not None)
    with pytest.raises(InputError, match="ur5e"):
        read_controller_files(file, told=Told.of({"arm": "kr6"}))


def test_what_joints_do_not_tell() -> None:
    assert identity_by_joints(given(None, TOOL)[:2], FLANGE[:2]) is None
    assert identity_by_joints([FLANGE[0]] * 5, [FLANGE[0]] * 5) is None  # a tool and a frame look alike
    assert identity_by_joints(given(None, None), FLANGE[1:] + FLANGE[:1]) is None  # other captures' joints
    assert identity_by_joints(given(FRAME, TOOL), FLANGE) is None  # both at once are not tried
