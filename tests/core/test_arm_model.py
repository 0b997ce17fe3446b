"""The arm's own errors, solved with the tool: what they bring, when they are applied, and who uses them."""

import contextlib
import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib_core.archive.folder import save_session
from calib_core.arms.errors import _to_next, arm_moves, arm_terms
from calib_core.arms.inverse import joints_of_pose
from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.exports.export import export
from calib_core.findings.catalogues import catalogue
from calib_core.messages import made_lately
from calib_core.records import Session
from calib_core.records.evidence import Quantity, Table
from calib_core.stages.tcp.record import TcpResult
from server.cli import main
from tests.arm_cell import ArmCell, held_out_rms_mm, simulate_arm
from tests.benchmarks import bench_arm, bench_paper, paper_cell

solved = bench_arm.solved


def codes_of(result: TcpResult) -> set[str]:
    return {finding.code for finding in result.findings}


def told(cell: ArmCell, **robot: object) -> Session:
    """Return the cell's session with other things told of its robot."""
    record = cell.session.model_dump(exclude_none=True, by_alias=True)
    record["cell"]["robot"] |= robot
    return Session.model_validate(record)


def test_an_arm_has_as_many_terms_as_its_geometry() -> None:
    names = [term.name for term in arm_terms(NAMED_ARMS["ur10e"])]
    of_geometry = [name for name in names if "_by_" not in name and "sag" not in name]
    assert len(of_geometry) == len(set(of_geometry)) == 18  # 4 · 6 + 6, less base and tool
    moves = arm_moves(NAMED_ARMS["ur10e"], np.random.default_rng(0).uniform(-120, 120, (40, 6)).tolist())
    some = moves[:, :, [names.index(name) for name in of_geometry]]
    some *= np.array([1.0, 1.0, 1.0, 300.0, 300.0, 300.0])[:, None]
    flat = some.reshape(-1, 18) / np.linalg.norm(some.reshape(-1, 18), axis=0)
    assert np.linalg.svd(flat, compute_uv=False)[-1] > 1e-3  # none of them is said twice


def test_a_zero_moves_the_flange_as_its_joint_does() -> None:
    arm, joints = NAMED_ARMS["ur5e"], [10.0, -70.0, 80.0, -100.0, -80.0, 20.0]
    names = [term.name for term in arm_terms(arm)]
    move = arm_moves(arm, [joints])[0][:, names.index("joint_3_zero_deg")]
    ends = [flange_of_joints(arm, [*joints[:2], joints[2] + by, *joints[3:]]) for by in (-0.01, 0.01)]
    assert np.allclose(move[:3], (ends[1].translation_mm - ends[0].translation_mm) / 0.02, atol=1e-4)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("kind", ["small", "cobot", "large"])
def test_other_poses_are_predicted_better_where_the_arm_is_applied(kind: str, tmp_path: Path) -> None:
    cell = simulate_arm(kind, 3, 30, errors="apply")
    covered, applied = solved(told(cell, errors="cover")), solved(cell.session)
    assert covered.arm_model is not None
    assert applied.arm_model is not None
    assert covered.arm_model.worth_it
    assert not covered.arm_model.applied
    assert "arm-errors-worth-it" in codes_of(covered)
    assert "arm-errors-applied" in codes_of(applied)
    before, after = applied.arm_model.held_out_rms_mm
    save_session(tmp_path / "cell", cell.session, {})
    table = tmp_path / "joints.csv"
    with table.open("w", newline="") as file:
        csv.writer(file).writerows([[f"j{n}_deg" for n in range(1, 7)], *cell.held_joints_deg.tolist()])
    poses, beyond_deg = corrected_by_command(table, tmp_path)
    reached = np.array([one.joints_deg for one in cell.session.captures])[:, 1:]
    off = np.maximum(
        reached.min(axis=0) - cell.held_joints_deg[:, 1:], cell.held_joints_deg[:, 1:] - reached.max(axis=0)
    )
    assert beyond_deg == pytest.approx(off.max(axis=1).clip(0), abs=1e-9)
    real_after = held_out_rms_mm(cell, *placed(applied), poses)
    real_before = held_out_rms_mm(cell, *placed(covered), cell.held_poses)
    assert real_after < 0.5 * real_before
    assert after < 0.7 * before
    assert real_after < 2 * after


def test_an_answer_tells_the_arms_errors_one_by_one() -> None:
    cell = simulate_arm("small", 4, 15, errors="apply")
    result = solved(cell.session)
    assert result.arm_model is not None
    (table,) = [block for block in result.evidence or [] if isinstance(block, Table) and block.id == "arm"]
    assert len(table.rows) == len(result.arm_model.names)
    labels = [row.cells[0] for row in table.rows]
    assert {"Zero of joint 2", "Length of link 3"} <= set(labels)
    zero = table.rows[labels.index("Zero of joint 2")].cells[1]
    assert isinstance(zero, Quantity)
    assert zero.value == result.arm_model.values[result.arm_model.names.index("joint_2_zero_deg")]
    assert f"{result.arm_model.held_out_rms_mm[1]:.2f} mm instead of" in str(table.caption)
    assert (made := made_lately("Zero of joint 2")) is not None
    assert catalogue("de").say(made) == "Nullstellung von Gelenk 2"


def test_poses_taken_again_tell_repeatability_as_iso_9283_words_it() -> None:
    record = simulate_arm("small", 4, 12).session.model_dump(exclude_none=True, by_alias=True)
    first, rng = record["captures"][0], np.random.default_rng(3)
    centers = np.array(first["center_mm"]) + rng.normal(0, 0.05, (5, 3))
    record["captures"] += [
        first | {"id": f"again-{n}", "center_mm": c.tolist()} for n, c in enumerate(centers)
    ]  # fmt: skip
    result = solved(Session.model_validate(record))
    (table,) = [block for block in result.evidence or [] if isinstance(block, Table) and block.id == "iso-9283"]
    (row,) = table.rows
    assert row.cells[0] == first["id"]
    assert isinstance(row.cells[1], Quantity)
    assert row.cells[1].value == 6
    apart = np.linalg.norm((every := np.vstack([first["center_mm"], centers])) - every.mean(axis=0), axis=1)
    assert isinstance(row.cells[2], Quantity)
    assert row.cells[2].value == pytest.approx(apart.mean() + 3 * apart.std(ddof=1), abs=1e-6)


def placed(result: TcpResult) -> tuple[np.ndarray, np.ndarray]:
    return np.array(result.base_from_laser), np.array(result.sphere_center_in_tool0_mm)


def corrected_by_command(table: Path, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        assert main(["poses", str(table), "--corrected", str(folder / "cell"), "--json"]) == 0
    told = json.loads(text.getvalue())
    assert told["held_out_rms_mm"][1] < told["held_out_rms_mm"][0]
    rows = told["poses"]
    return np.array([row["base_from_tool0"] for row in rows]), np.array([r["beyond_captures_deg"] for r in rows])


def test_a_right_arm_keeps_its_answer() -> None:
    cell = simulate_arm("medium", 5, 30, size=0.0, errors="apply")
    applied, covered = solved(cell.session), solved(told(cell, errors="cover"))
    without = solved(told(cell, errors=None, arm=None))
    assert applied.arm_model is not None
    assert not applied.arm_model.worth_it
    assert not applied.arm_model.applied
    assert applied.base_from_laser == covered.base_from_laser == without.base_from_laser
    assert without.arm_model is None
    assert "arm-errors-not-better" in codes_of(applied)


def test_few_captures_are_decided_by_their_likelihood_where_poses_left_out_cannot_tell() -> None:
    cell = simulate_arm("large", 21003, 8, errors="apply")
    applied, covered = solved(cell.session), solved(told(cell, errors="cover"))
    assert applied.arm_model is not None
    before, after = applied.arm_model.held_out_rms_mm
    assert after > 0.95 * before  # three groups of poses do not show it
    assert applied.arm_model.decided_by == "likelihood"
    real = bench_arm.held_out(cell, applied), bench_arm.held_out(cell, solved(bench_arm.without_arm(cell)))
    assert real[0] < 0.95 * real[1]
    for result, code in ((applied, "arm-errors-applied"), (covered, "arm-errors-worth-it")):
        (finding,) = [one for one in result.findings if one.code == code]
        assert "cannot tell" in finding.text
        assert f"{before:.2f} mm without them" in finding.text
        (table,) = [one for one in result.evidence or [] if isinstance(one, Table) and one.id == "arm"]
        assert str(table.caption) == finding.text


@pytest.mark.thorough
def test_a_turntable_cells_answer_tells_the_poses_that_belong_to_it() -> None:
    cell = paper_cell.simulate(0, "arm")
    answer = bench_paper.solved(cell, "chain", arm_known=True)
    as_told = replace(answer, poses=[shot.told for shot in cell.scans])
    assert bench_paper.spread_over_table(cell, answer) < 0.15
    assert bench_paper.spread_over_table(cell, as_told) > 0.3


@pytest.mark.thorough
def test_exports_give_the_answer_for_the_controllers_poses() -> None:
    cell = simulate_arm("small", 4, 20, errors="apply")
    applied, covered = solved(cell.session), solved(told(cell, errors="cover"))

    def exported(**settings: str) -> list[list[float]]:
        content, _ = export(cell.session, {"tcp": applied}, "json", settings=settings)
        return json.loads(content)["base_from_laser"]

    assert np.allclose(exported(), covered.base_from_laser or [])
    assert np.allclose(exported(poses="corrected"), applied.base_from_laser or [])

    def written(result: TcpResult, poses: str = "controller") -> str:
        return export(cell.session, {"tcp": result}, "kuka", settings={"poses": poses})[0].decode()

    assert "for the controller's own poses, not for those corrected" in written(applied)
    assert "for poses corrected by the arm's errors, not for" in written(applied, "corrected")


def test_joints_follow_from_a_pose_in_the_configuration_of_others() -> None:
    arm, joints = NAMED_ARMS["ur10e"], [20.0, -80.0, 95.0, -110.0, -85.0, 30.0]
    found = joints_of_pose(arm, flange_of_joints(arm, joints), [0.0, -70.0, 80.0, -100.0, -90.0, 0.0])
    assert found is not None
    assert np.allclose(found[0], joints, atol=1e-4)


@pytest.mark.parametrize("name", bench_arm.WRONG)
def test_wrong_joints_are_named_and_nothing_is_applied(name: str) -> None:
    cell = simulate_arm("small", 7, 15, errors="apply")
    result = solved(bench_arm.with_wrong_joints(cell.session, name))
    assert result.arm_model is None
    (finding,) = [one for one in result.findings if one.code == "joints-read-otherwise"]
    assert bench_arm.WRONG[name] in finding.text
    assert ("the arm irb120 would" in finding.text) == (name == "table")


def test_joints_of_another_arm_are_named() -> None:
    cell = simulate_arm("cobot", 7, 15, errors="apply")
    assert "the arm ur10e" in next(
        one.text for one in solved(told(cell, arm="ur5e")).findings if one.code == "joints-read-otherwise"
    )


@pytest.mark.parametrize("behind", [2, 4, 5])
def test_a_coupled_joint_moves_the_flange_by_the_reading_of_the_one_before(behind: int) -> None:
    arm, joints = NAMED_ARMS["ur5e"], [10.0, -70.0, 80.0, -100.0, -80.0, 20.0]
    names = [term.name for term in arm_terms(arm)]
    move = arm_moves(arm, [joints])[0][:, names.index(f"joint_{behind + 1}_by_joint_{behind}_deg_per_deg")]
    ends = [
        flange_of_joints(arm, [one + by * joints[behind - 1] * (k == behind) for k, one in enumerate(joints)])
        for by in (-1e-5, 1e-5)
    ]
    assert np.allclose(move[:3], (ends[1].translation_mm - ends[0].translation_mm) / 2e-5, atol=0.01)


@pytest.mark.parametrize(
    ("between", "turned"),
    [([3.0, 40.0, 5.0], 1.2), ([0.0, 0.0, 70.0], 0.5), ([30.0, -20.0, 9.0], 0.0), ([0.0, 0.0, 50.0], 0.0)],
    ids=["skew", "crossing", "parallel", "one line"],
)
@pytest.mark.parametrize("beyond", [[10.0, 0.0, 0.0], [0.0, 0.0, 80.0], None])
def test_the_common_normal_of_two_axes_is_square_to_both_from_where_they_are_nearest(
    between: list[float], turned: float, beyond: list[float] | None
) -> None:
    axes = [np.array([0.0, 0.0, 1.0]), np.array([0.0, np.sin(turned), np.cos(turned)])]
    points = [np.array([100.0, 50.0, 20.0])]
    points.append(points[0] + between)
    if beyond is not None:
        points.append(points[1] + beyond)
    parallel, normal, foot = _to_next(np.array(points), np.array(axes), 0)
    assert parallel == (turned == 0.0)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert [normal @ axes[0], normal @ axes[1]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.linalg.norm(np.cross(foot - points[1], axes[1])) == pytest.approx(0.0, abs=1e-9)
    off = foot - points[0]
    if not parallel:  # no other place of the next axis is nearer to this one
        assert np.linalg.norm(off - (off @ axes[0]) * axes[0]) <= min(
            np.linalg.norm(np.cross(foot + step * axes[1] - points[0], axes[0])) for step in (-0.1, 0.1)
        )
    elif np.linalg.norm(between[:2]) > 0:
        assert normal * np.linalg.norm(between[:2]) == pytest.approx([*between[:2], 0.0])
