"""Captures that are kept but not used, arms' forward kinematics, and the verification."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.arms.kinematics import NAMED_ARMS, arm_of, flange_of_joints, links_mm
from calib_core.captures.contradictions import unfit
from calib_core.causes.flange import flange_findings
from calib_core.errors import InputError, MotionError
from calib_core.findings import reasons_of, sentence_of
from calib_core.records import ArmJoint, ArmTable, Capture, Cell, Session
from calib_core.robots import to_pose
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run

JOINTS = [[10.0 * k, -80.0 + 5 * k, 95.0 - 3 * k, -100.0, 85.0 + k, 20.0 * k] for k in range(6)]


def left_out(cell: Cell, captures: list[Capture]) -> dict[str, str]:
    return reasons_of(unfit(cell, captures))


def told_by_joints(cell: Cell, captures: list[Capture]) -> str:
    return " ".join(sentence_of(finding) for finding in flange_findings(cell, captures))


def test_an_arm_at_zero_stands_where_its_lengths_say() -> None:
    flange = flange_of_joints(NAMED_ARMS["ur5e"], [0.0] * 6)
    np.testing.assert_allclose(flange.translation_mm, [-817.2, -232.9, 62.8], atol=1e-9)


def test_both_conventions_and_prismatic_joints() -> None:
    joints = [ArmJoint(d_mm=100.0), ArmJoint(a_mm=300.0, kind="prismatic")]
    standard = flange_of_joints(ArmTable(joints=joints), [90.0, None], [None, 50.0])
    np.testing.assert_allclose(standard.translation_mm, [0.0, 300.0, 150.0], atol=1e-9)
    modified = flange_of_joints(ArmTable(joints=joints, convention="modified"), [90.0, None], [None, 50.0])
    np.testing.assert_allclose(modified.translation_mm, [0.0, 300.0, 150.0], atol=1e-9)
    with pytest.raises(InputError, match="joint 2"):
        flange_of_joints(ArmTable(joints=joints), [90.0])
    with pytest.raises(InputError, match="ur5e"):
        arm_of("no such arm")


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_the_line_along_an_arm_has_its_lengths_and_ends_at_its_flange(convention: str) -> None:
    arm = NAMED_ARMS["ur5e"].model_copy(update={"convention": convention})
    joints = [20.0, -70.0, 95.0, -40.0, 80.0, 10.0]
    corners = links_mm(arm, joints)
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = [(j.d_mm, j.a_mm) if convention == "standard" else (j.a_mm, j.d_mm) for j in arm.joints]
    np.testing.assert_allclose(steps, [*np.abs(along).ravel(), 0.0], atol=1e-9)
    np.testing.assert_allclose(corners[0], 0, atol=1e-12)
    np.testing.assert_allclose(corners[-1], flange_of_joints(arm, joints).translation_mm, atol=1e-9)


def captures_of(**more: Any) -> list[Capture]:
    """Captures at six postures of an arm, the fourth with other fields than the rest."""
    arm = NAMED_ARMS["ur5e"]
    base: dict[str, Any] = {"step": "tcp", "kind": "profile", "files": ["captures/a.csv"], "active_tool": 1}
    rows = [
        base | {"id": f"p{k}", "pose": to_pose("kuka", flange_of_joints(arm, joints)), "joints_deg": joints}
        for k, joints in enumerate(JOINTS)
    ]
    rows[3] |= more
    return [Capture.model_validate(row) for row in rows]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"moving": True}, "moving"),
        ({"active_tool": 2}, "its tool is 2"),
        ({"active_frame": 5}, ""),  # the others do not say theirs
        ({"scanner": "left"}, ""),
        ({"joints_deg": JOINTS[0]}, "its joints put the flange"),
        ({"moving": False, "device_time_s": 3.5, "source": "a.src:3"}, ""),
    ],
)
def test_one_that_contradicts_the_others_is_not_used(more: dict[str, Any], words: str) -> None:
    cell = simulate("tcp", 1).session.cell
    cell = cell.model_copy(
        update={"pose_convention": "kuka", "robot": cell.robot.model_copy(update={"arm": "ur5e"})}
    )
    found = left_out(cell, captures_of(**more))
    assert list(found) == (["p3"] if words else [])
    assert words in found.get("p3", "")


def test_where_no_joints_give_their_pose_the_arm_is_at_fault() -> None:
    cell = simulate("tcp", 1).session.cell
    cell = cell.model_copy(
        update={"pose_convention": "kuka", "robot": cell.robot.model_copy(update={"arm": "ur10e"})}
    )
    assert left_out(cell, captures_of()) == {}
    for some in (captures_of(), captures_of()[:1]):
        told = told_by_joints(cell, some)
        assert f"The joints of {len(some)} of {len(some)} captures do not give their poses" in told


def test_a_scanner_that_the_cell_does_not_have_is_told() -> None:
    cell = simulate("tcp", 1).session.cell
    cell = cell.model_copy(update={"pose_convention": "kuka", "scanners": {"left": cell.scanner}})
    named = [capture.model_copy(update={"scanner": "left"}) for capture in captures_of()]
    assert left_out(cell, named) == {}
    named[1] = named[1].model_copy(update={"scanner": "lft"})
    assert left_out(cell, named) == {named[1].id: "its scanner lft is none of the cell's (left)"}


def test_joints_tell_that_a_tool_was_active_and_the_answer_says_so() -> None:
    cell = simulate("tcp", 1).session.cell
    robot = cell.robot.model_copy(update={"arm": "ur5e"})
    cell = cell.model_copy(update={"pose_convention": "matrix", "robot": robot})
    tool = np.array([[0, -1, 0, 30], [1, 0, 0, 0], [0, 0, 1, 120], [0, 0, 0, 1.0]])

    def posed(after: np.ndarray) -> list[Capture]:
        arm = NAMED_ARMS["ur5e"]
        return [
            c.model_copy(update={"pose": (flange_of_joints(arm, joints).matrix @ after).ravel().tolist()})
            for c, joints in zip(captures_of(), JOINTS, strict=True)
        ]

    assert told_by_joints(cell, posed(np.eye(4))) == ""
    told = told_by_joints(cell, posed(tool))
    assert "of a tool on it at x 30, y 0, z 120 mm, 90°" in told
    assert left_out(cell, posed(tool)) == {}
    assert (
        told_by_joints(cell.model_copy(update={"robot": robot.model_copy(update={"arm": None})}), posed(tool))
        == ""
    )


def with_captures(session: Session, **changes: dict[str, Any]) -> Session:
    return session.model_copy(
        update={"captures": [c.model_copy(update=changes.get(c.id, {})) for c in session.captures]}
    )


def test_a_moving_capture_is_kept_and_told_and_a_table_before_a_fixed_scanner_is_to_turn() -> None:
    simulated = simulate("tcp", 5)
    first = simulated.session.captures[4].id
    result = run(with_captures(simulated.session, **{first: {"moving": True}}), simulated.files.__getitem__)["tcp"]
    row = next(row for row in result.residuals if row.capture == first)  # type: ignore[attr-defined]
    assert not row.used
    assert "moving" in str(row.reason)
    cell = simulated.session.cell.model_copy(update={"arrangement": "sphere-on-robot"})
    turned = simulated.session.model_copy(update={"cell": cell})
    on_table = [c.model_copy(update={"step": "turntable", "table_deg": 0.0}) for c in turned.captures]
    with pytest.raises(MotionError, match="no mounting has three different angles"):
        run(turned.model_copy(update={"captures": on_table}), simulated.files.__getitem__, "turntable")


def test_held_out_captures_scatter_as_the_uncertainties_say() -> None:
    simulated = simulate("tcp", 5)
    captures = [
        c.model_copy(update={"step": "verify"} if k in (4, 7, 10, 12) else {})
        for k, c in enumerate(simulated.session.captures)
    ]
    session = simulated.session.model_copy(update={"captures": captures})
    results: dict[str, Any] = run(session, simulated.files.__getitem__)
    verified = results["verify"]
    assert verified.verdict == "pass"
    assert verified.verified == "tcp"
    assert verified.degrees_of_freedom == 9
    assert 0.3 < verified.held_out_scatter_rms_mm / verified.expected_scatter_rms_mm < 2.5
    center = np.array(simulated.truth["sphere_center_in_base_mm"])
    assert np.linalg.norm(np.array(verified.sphere_center_in_base_mm) - center) < 1.5
    wrong = np.array(results["tcp"].tool0_from_laser)
    wrong[:3, 3] += [4.0, -3.0, 5.0]
    known = session.cell.known.model_copy(update={"tool0_from_laser": wrong.tolist()})
    robot = session.cell.robot.model_copy(update={"position_sigma_mm": 0.05, "orientation_sigma_deg": 0.01})
    cell = session.cell.model_copy(update={"known": known, "robot": robot})
    failed: Any = run(session.model_copy(update={"cell": cell}), simulated.files.__getitem__)["verify"]
    assert (failed.verdict, failed.verified) == ("fail", "known")


def _turned(axis: str, deg: float) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler(axis, deg, degrees=True).as_matrix()
    return made


def _shifted(*along: float) -> np.ndarray:
    made = np.eye(4)
    made[:3, 3] = along
    return made


@pytest.mark.parametrize(
    ("name", "signs", "upper", "lengths"),
    [
        ("irb120", (1, 1, 1), "z", (290, 0, 270, 70, 302, 72)),
        ("irb2600-12/1.65", (1, 1, 1), "z", (445, 150, 700, 115, 795, 85)),
        ("kr6-r900-sixx", (-1, -1, -1), "x", (400, 25, 455, 35, 420, 80)),
    ],
)
def test_a_named_arm_puts_its_flange_where_its_axes_say(
    name: str, signs: tuple[int, int, int], upper: str, lengths: tuple[float, ...]
) -> None:
    d1, a1, a2, a3, d4, d6 = lengths
    q = [20.0, -35.0, 50.0, 70.0, -40.0, 110.0]
    wanted = _shifted(0, 0, d1) @ _turned("z", signs[0] * q[0]) @ _shifted(a1, 0, 0) @ _turned("y", q[1])
    wanted = wanted @ (_shifted(0, 0, a2) if upper == "z" else _shifted(a2, 0, 0)) @ _turned("y", q[2])
    wanted = wanted @ _shifted(0, 0, a3) @ _turned("x", signs[1] * q[3]) @ _shifted(d4, 0, 0) @ _turned("y", q[4])
    wanted = wanted @ _shifted(d6, 0, 0) @ _turned("x", signs[2] * q[5]) @ _turned("y", 90)
    assert np.allclose(flange_of_joints(NAMED_ARMS[name], q).matrix, wanted, atol=1e-6)
