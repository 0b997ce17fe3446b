"""Rechecks: what three repeated captures of a simulated cell say, unchanged and changed."""

from dataclasses import replace
from typing import Any

import bench_recheck
import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import MotionError
from calib_core.library.opened import in_memory
from calib_core.records import Measured, Session, Verification, parse_session
from calib_core.simulation import SimulatedSession, retake, simulate
from calib_core.stages.capability import capability
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import run
from calib_core.stages.recheck.guide import recheck_plan
from calib_core.stages.recheck.record import RecheckResult, RecheckRound
from tests.arm_cell import later_on_an_arm


def test_changes_are_found_and_false_alarms_are_rare() -> None:
    rows = bench_recheck.figures(range(2), 2)
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows[:4] if not r.holds] == []


@pytest.fixture(scope="module")
def solved() -> tuple[SimulatedSession, dict[str, Any]]:
    simulated = simulate("tcp", 2)
    return simulated, {"tcp": run(simulated.session, simulated.files.__getitem__, "tcp")["tcp"].to_json()}


def again(
    solved: tuple[SimulatedSession, dict[str, Any]], rounds: list[float]
) -> tuple[Session, dict[str, bytes]]:
    """Return the session with rounds of a recheck, the scanner shifted on its flange by so much in each."""
    simulated, results = solved
    assert simulated.world is not None
    data, files = simulated.session.to_json(), dict(simulated.files)
    for number, shift_mm in enumerate(rounds):
        tool = simulated.world.tool0_from_laser.copy()
        tool[0, 3] += shift_mm
        moved = replace(simulated, world=replace(simulated.world, tool0_from_laser=tool))
        for pose in recheck_plan(simulated.session, results).poses:
            record, own = retake(moved, pose.capture, f"r{number}-{pose.capture}", 7 + number)
            data["captures"].append({**record.to_json(), "step": "recheck"})
            files |= own
    return parse_session(data, "session"), files


def result_of(solved: tuple[SimulatedSession, dict[str, Any]], rounds: list[float]) -> RecheckResult:
    session, files = again(solved, rounds)
    result = run(session, files.__getitem__, "recheck")["recheck"]
    assert isinstance(result, RecheckResult)
    return result


@pytest.mark.thorough
def test_the_last_round_decides_and_the_rounds_tell_the_course(solved: Any) -> None:
    result = result_of(solved, [0.0, 1.5])
    assert [one.changed == "nothing" for one in result.rounds] == [True, False]
    assert (result.holds, result.verdict) == (False, "fail")
    assert result.change_mm == pytest.approx(1.5, abs=1.5 * result.uncertainty_mm)
    assert result.changed in ("tool", "tool-or-sphere")
    assert [row.repeats for row in result.residuals[:3]] == [row.repeats for row in result.residuals[3:]]
    assert "no longer holds" in str(result)


def test_an_unchanged_cell_still_holds_and_the_guide_leads_there(solved: Any) -> None:
    result = result_of(solved, [0.0])
    assert (result.holds, result.verdict) == (True, "pass")
    session, _ = again(solved, [0.0])
    begun = session.model_copy(update={"captures": session.captures[:-2]})
    measured = [Measured(capture=c.id, kind=c.kind, verdict="pass") for c in session.captures]
    now = guide(begun, measured, solved[1]).current
    assert (now.step, now.action, now.still_needed) == ("recheck", "capture", 2)
    assert now.suggested_pose is not None
    assert guide(session, measured, solved[1]).current.action == "solve"
    assert guide(session, measured, {**solved[1], "recheck": result.to_json()}).current.action == "review"


def test_the_library_rechecks_arrays(solved: Any) -> None:
    record, files = again(solved, [0.0])
    session = in_memory(record, files)
    steps = [[c for c in session.captures if c.step == step] for step in ("tcp", "recheck")]
    before, now = (
        cc.Captures([cc.scan_points(session, c) for c in captures], [c.pose for c in captures])
        for captures in steps
    )
    assert cc.recheck_tcp(session.cell, before, now).holds


def test_captures_from_other_poses_are_refused_with_what_to_do(solved: Any) -> None:
    session, files = again(solved, [0.0])
    data = session.to_json()
    for capture in data["captures"][-3:]:
        capture["pose"][0] += 100.0
    with pytest.raises(MotionError, match="poses of the calibration"):
        run(parse_session(data, "session"), files.__getitem__, "recheck")
    with pytest.raises(MotionError, match="Solve the TCP first"):
        recheck_plan(session, {})


def test_copies_of_the_calibration_are_no_recheck(solved: Any) -> None:
    session, files = again(solved, [0.0, 0.0, 0.0])
    first = {capture.id: capture for capture in session.captures}
    captures = [
        one.model_copy(update={"files": first[one.id[3:]].files, "pose": first[one.id[3:]].pose})
        if one.step == "recheck" else one
        for one in session.captures
    ]  # fmt: skip
    with pytest.raises(MotionError, match="the same file and pose"):
        run(session.model_copy(update={"captures": captures}), files.__getitem__, "recheck")


@pytest.mark.thorough
def test_capability_is_that_of_the_rounds_against_the_tolerance(solved: Any) -> None:
    rng = np.random.default_rng(8)
    offset = np.array([0.02, 0.0, 0.0])
    changes = rng.normal(size=(400, 3)) * [0.004, 0.01, 0.005] + offset
    plain = {"change_mm": 0.0, "uncertainty_mm": 0.1, "chance": 0.5, "changed": "nothing", "sentence": ""}
    rounds = [
        RecheckRound.model_validate({**plain, "captures": ["r"], "change_in_laser_mm": list(one)})
        for one in changes
    ]
    repeatability, bias, cg, cgk = capability(rounds, 1.0)
    assert repeatability == pytest.approx(0.01, rel=0.1)
    assert bias == pytest.approx(0.02, rel=0.1)
    assert cg == pytest.approx(0.1 / (3 * 0.01), rel=0.1)
    assert cgk == pytest.approx(0.1 / (3 * 0.01), rel=0.1)  # y is the worst axis, and has no bias

    session, files = again(solved, [0.0, 0.0, 0.0])
    limited = session.model_copy(
        update={"cell": session.cell.model_copy(update={"verification": Verification(tool_mm=0.4)})}
    )
    result = run(limited, files.__getitem__, "recheck")["recheck"]
    tables = [block for block in result.evidence if block.kind == "table" and block.id == "capability"]
    assert len(tables) == 1
    assert "± 0.4 mm" in tables[0].caption


def on_an_arm(seed: int, **since: Any) -> RecheckResult:
    """Return what eight repeated captures of a known arm say."""
    result = run(later_on_an_arm("small", seed, "recheck", **since), lambda name: b"", "recheck")["recheck"]
    assert isinstance(result, RecheckResult)
    return result


@pytest.mark.parametrize("joint", [2, 3, 4, 5])
def test_the_joint_whose_zero_moved_is_named(joint: int) -> None:
    result = on_an_arm(joint, bumped_deg=[0.15 * (n + 1 == joint) for n in range(6)])
    (told,) = result.rounds
    assert (told.changed, told.joint) == ("joint", joint)
    assert told.joint_deg is not None
    assert told.joint_uncertainty_deg is not None
    assert abs(told.joint_deg - 0.15) < 1.5 * told.joint_uncertainty_deg < 0.1
    assert f"zero of joint {joint} moved by" in str(result)


def test_no_joint_is_named_where_another_thing_moved() -> None:
    nothing, tracker, ball = on_an_arm(7), on_an_arm(7, tool_mm=1.0), on_an_arm(7, ball_mm=1.0)
    assert nothing.changed == "nothing"
    assert {tracker.rounds[0].joint, ball.rounds[0].joint} == {None}
    assert not tracker.holds
    assert not ball.holds


def recaptured(name: str, shifted: str | None = None, shift_mm: float = 0.0) -> RecheckResult:
    """Return what captures of the planned poses say, made again with other noise, one scanner shifted along x."""
    opened, _ = cc.simulate(name, 1)
    record, files = opened.record.to_json(), {one: opened.read(one) for c in opened.captures for one in c.files}
    results = {stage: result.to_json() for stage, result in opened.run().items()}
    plan, by_id = recheck_plan(opened.record, results), {one["id"]: one for one in record["captures"]}
    rng = np.random.default_rng(3)
    for capture in [by_id[pose.capture] for pose in plan.poses]:
        again = f"captures/again-{capture['id']}.csv"
        x, z = np.genfromtxt(files[capture["files"][0]].decode().splitlines()[1:], delimiter=",").T
        off_mm = shift_mm if capture.get("scanner") == shifted else 0.0
        z = z + 0.02 * rng.standard_normal(len(z))
        files[again] = (
            "x_mm,z_mm\n" + "".join(f"{a + off_mm:.4f},{b:.4f}\n" for a, b in zip(x, z, strict=True))
        ).encode()
        record["captures"].append({**capture, "id": f"r-{capture['id']}", "step": "recheck", "files": [again]})
    session = parse_session(record, "session")
    assert recheck_plan(session, results).still_needed == 0
    result = run(session, files.__getitem__, "recheck")["recheck"]
    assert isinstance(result, RecheckResult)
    return result


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("name", "poses", "shifted"),
    [
        ("scanners-on-flange-and-base", 6, "gate"),
        ("fixed-scanner-turntable", 3, None),
        ("plate", 3, None),
        ("scara", 3, None),
        ("gantry-turntable", 3, None),
    ],
)
def test_each_scanner_is_rechecked_by_its_own_poses(name: str, poses: int, shifted: str | None) -> None:
    holds = recaptured(name)
    assert (holds.holds, holds.verdict, len(holds.residuals)) == (True, "pass", poses)
    changed = recaptured(name, shifted, 1.5)
    assert not changed.holds
    assert changed.rounds[0].scanner == shifted
    assert changed.change_mm == pytest.approx(1.5, abs=1.5 * changed.uncertainty_mm)
    assert shifted is None or f"'{shifted}'" in str(changed.warnings)
