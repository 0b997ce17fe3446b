"""An arm from its URDF: the same place as its table says, and what is no arm refused with a reason."""

import json
from pathlib import Path

import numpy as np
import pytest

from calib_core.archive.folder import load_session
from calib_core.arms.kinematics import NAMED_ARMS, arm_of, flange_of_joints, links_mm
from calib_core.arms.urdf import arm_from_urdf
from calib_core.errors import InputError, TooLargeError
from calib_core.frames import FloatArray, RigidTransform


def _joint(name: str, kind: str, ends: str, origin: str, axis: str = "", limit: str = "") -> str:
    parent, child = ends.split(" > ")
    xyz, rpy = origin.split(" | ")
    inside = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
    inside += f'<axis xyz="{axis}"/>' if axis else ""
    low, high = limit.split() if limit else ("", "")
    inside += f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/>' if limit else ""
    return f'<joint name="{name}" type="{kind}">{inside}</joint>'


_HALF, _QUARTER = repr(np.pi), repr(np.pi / 2)
# The lengths of a UR5e that its maker publishes, drawn link by link as descriptions do it: axes along y, z and −z.
UR5E = "\n".join(
    [
        '<?xml version="1.0"?><robot name="arm"><link name="world"/>',
        '<link name="base_link"><visual><geometry><mesh filename="package://a/b.dae"/></geometry></visual></link>',
        _joint("stand", "fixed", "world > base_link", "1 2 3 | 0 0 0.5"),
        _joint("turned", "fixed", "base_link > base", f"0 0 0 | 0 0 {_HALF}"),
        _joint(
            "pan", "revolute", "base_link > shoulder", f"0 0 0.1625 | 0 0 {_HALF}", "0 0 1", f"-{_HALF} {_HALF}"
        ),
        _joint("lift", "revolute", "shoulder > upper", "0 0 0 | 0 0 0", "0 -1 0", f"-{_QUARTER} {_QUARTER}"),
        _joint("elbow", "continuous", "upper > fore", "-0.425 0 0 | 0 0 0", "0 -1 0"),
        _joint("wrist1", "continuous", "fore > w1", "-0.3922 -0.1333 0 | 0 0 0", "0 -1 0"),
        _joint("wrist2", "continuous", "w1 > w2", "0 0 -0.0997 | 0 0 0", "0 0 -1"),
        _joint("wrist3", "continuous", "w2 > w3", "0 -0.0996 0 | 0 0 0", "0 -1 0"),
        _joint("end", "fixed", "w3 > tool0", f"0 0 0 | {_QUARTER} 0 0"),
        _joint("finger", "prismatic", "tool0 > f", "0 0 0 | 0 0 0", "1 0 0", "0 0.05"),
        '<transmission name="t"><joint name="pan"/></transmission></robot>',
    ]
)

POSTURES = [[0.0] * 6, [20.0, -70.0, 95.0, -40.0, 80.0, 10.0], [-130.0, -20.0, 60.0, 15.0, -75.0, 200.0]]


@pytest.mark.parametrize("joints", POSTURES)
def test_a_chain_of_links_puts_the_flange_where_the_arms_table_does(joints: list[float]) -> None:
    arm = arm_from_urdf(UR5E.encode(), "ur5e.urdf")
    by_table, by_links = flange_of_joints(NAMED_ARMS["ur5e"], joints), flange_of_joints(arm, joints)
    np.testing.assert_allclose(by_links.translation_mm, by_table.translation_mm, atol=1e-6)
    np.testing.assert_allclose(by_links.rotation, by_table.rotation, atol=1e-9)
    corners = links_mm(arm, joints)
    np.testing.assert_allclose(corners[0], 0, atol=1e-9)
    np.testing.assert_allclose(corners[-1], by_table.translation_mm, atol=1e-6)


def test_names_limits_and_ends_are_told() -> None:
    arm = arm_from_urdf(UR5E.encode(), "ur5e.urdf")
    assert [joint.name for joint in arm.joints] == ["pan", "lift", "elbow", "wrist1", "wrist2", "wrist3"]
    np.testing.assert_allclose(arm.joints[1].limits or (), [-90.0, 90.0])
    assert arm.joints[2].limits is None
    assert arm.source == "ur5e.urdf: base → tool0"
    # Between other links: the finger slides along x, and base_link is turned half about z against base.
    longer = arm_from_urdf(UR5E.encode(), "ur5e.urdf", "base_link", "f")
    assert longer.joints[-1].kind == "prismatic"
    assert longer.joints[-1].limits == (0.0, 50.0)
    here = flange_of_joints(longer, [*POSTURES[1], None], [None] * 6 + [50.0])
    half = RigidTransform.of([0.0, 0.0, np.pi], [0.0, 0.0, 0.0], "base", "base")
    expected = half @ flange_of_joints(arm, POSTURES[1])
    np.testing.assert_allclose(here.translation_mm, expected.apply([50.0, 0.0, 0.0]), atol=1e-6)


def test_a_session_folder_names_its_urdf(tmp_path: Path) -> None:
    record = {"format": "scancell-session/1", "name": "n", "captures": []}
    cell = {"sphere_diameter_mm": 40.0, "pose_convention": "abb", "robot": {"arm": "robot.urdf"}}
    (tmp_path / "session.json").write_text(json.dumps({**record, "cell": cell}))
    with pytest.raises(InputError, match=r"robot\.urdf"):
        load_session(tmp_path)
    (tmp_path / "robot.urdf").write_text(UR5E)
    session, _ = load_session(tmp_path)
    assert session.cell.robot.arm is not None
    at: FloatArray = flange_of_joints(arm_of(session.cell.robot.arm), POSTURES[1]).translation_mm
    np.testing.assert_allclose(at, flange_of_joints(NAMED_ARMS["ur5e"], POSTURES[1]).translation_mm, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "entit"),
        ("<robot><joint", "whole XML"),
        ("<sdf/>", "<robot>"),
        ("<robot name='x'/>", "joints"),
        (UR5E.replace('xyz="-0.425 0 0"', 'xyz="${a} 0 0"'), "xacro"),
        (UR5E.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'), "direction"),
        (UR5E.replace('type="continuous"', 'type="floating"', 1), "floating"),
        (UR5E.replace('<link name="world"/>', "").replace('link="world"', 'link="f"'), "tree"),
        (UR5E.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><mimic joint="lift"/>'), "mimics"),
    ],
)
def test_what_is_no_arm_is_refused_with_a_reason(text: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        arm_from_urdf(text.encode(), "robot.urdf")


def test_links_that_are_not_there_and_files_without_end_are_refused() -> None:
    with pytest.raises(InputError, match="tool1"):
        arm_from_urdf(UR5E.encode(), "robot.urdf", tip="tool1")
    with pytest.raises(TooLargeError):
        arm_from_urdf(b" " * 5_000_001, "robot.urdf")


UR5E_CALIBRATION = """
kinematics:
  shoulder: {x: 0, y: 0, z: 0.1625, roll: 0, pitch: 0, yaw: 0}
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.570796326794897, pitch: 0, yaw: 0}
  forearm: {x: -0.425, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}
  wrist_1: {x: -0.3922, y: 0, z: 0.1333, roll: 0, pitch: 0, yaw: 0}
  wrist_2: {x: 0, y: -0.0997, z: 0, roll: 1.570796326794897, pitch: 0, yaw: 0}
  wrist_3: {x: 0, y: 0.0996, z: 0, roll: 1.570796326794897, pitch: 3.141592653589793, yaw: 3.141592653589793}
  hash: calib_1
"""
"""As the driver's description has it for an arm without errors."""


@pytest.mark.parametrize("joints", POSTURES)
def test_a_urs_calibration_is_its_arm(joints: list[float], tmp_path: Path) -> None:
    arm = arm_from_urdf(UR5E_CALIBRATION.encode(), "robot.yaml")
    at, nominal = flange_of_joints(arm, joints), flange_of_joints(NAMED_ARMS["ur5e"], joints)
    np.testing.assert_allclose(at.matrix, nominal.matrix, atol=1e-6)
    off = arm_from_urdf(UR5E_CALIBRATION.replace("x: -0.425,", "x: -0.4251,").encode(), "robot.yaml")
    moved = flange_of_joints(off, joints).translation_mm - nominal.translation_mm
    assert abs(float(np.linalg.norm(moved)) - 0.1) < 1e-6
    cell = {"sphere_diameter_mm": 40.0, "pose_convention": "abb", "robot": {"arm": "robot.yaml"}}
    record = {"format": "scancell-session/1", "name": "n", "captures": [], "cell": cell}
    (tmp_path / "session.json").write_text(json.dumps(record))
    (tmp_path / "robot.yaml").write_text(UR5E_CALIBRATION)
    assert load_session(tmp_path)[0].cell.robot.arm == arm


@pytest.mark.parametrize(
    "change", [("forearm", "elbow"), ("0.1625", "text"), ("0.1625", ".inf"), ("kinematics:\n", "kinematics: [")]
)
def test_what_is_no_calibration_is_refused(change: tuple[str, str]) -> None:
    with pytest.raises(InputError, match=r"robot\.yaml"):
        arm_from_urdf(UR5E_CALIBRATION.replace(*change).encode(), "robot.yaml")
