"""The verification's decision: its rule, its figures against the truth, and limits in a session."""

from dataclasses import replace

import bench_sign
import bench_verify
import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.frames import RigidTransform
from calib_core.records import Session, parse_session
from calib_core.records.evidence import Quantity, Table
from calib_core.robots import parse_pose, to_pose
from calib_core.simulation import retake, simulate, simulate_verify
from calib_core.simulation.verify_cell import VERIFY_SCENARIOS
from calib_core.stages.pipeline import run, solve_stage
from calib_core.stages.verify.decision import decided, probing
from calib_core.stages.verify.evidence import capability_of_captures
from calib_core.stages.verify.record import VerifyResult
from tests.verified import shifted, solved, verified_session


@pytest.mark.parametrize(
    ("value_mm", "decision"),
    [(0.79, "pass"), (0.81, "conditional-pass"), (-1.01, "conditional-fail"), (1.21, "fail")],
)
def test_the_rule_has_a_guard_band_on_both_sides(value_mm: float, decision: str) -> None:
    assert decided(value_mm, 0.2, 1.0) == decision


@pytest.mark.thorough
def test_false_passes_and_false_fails_are_rare() -> None:
    rows = bench_verify.figures(range(16))
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows if not r.holds] == []


def test_probing_form_and_size_are_those_of_the_points() -> None:
    rng = np.random.default_rng(3)
    caps = []
    for _ in range(8):
        directions = rng.normal(size=(300, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        caps.append(
            np.array([900.0, 100.0, 400.0]) + directions * (20.05 + rng.uniform(-0.02, 0.02, 300))[:, None]
        )
    found = probing(caps, 40.0, 0.001)
    assert found["size"].value_mm == pytest.approx(0.1, abs=0.003)
    assert found["form"].value_mm == pytest.approx(0.04, abs=0.002)
    assert found["form_95"].value_mm == pytest.approx(0.038, abs=0.001)
    assert found["size"].uncertainty_mm >= 0.002


def verified(off_mm: float) -> VerifyResult:
    cell = simulate("tcp-centers", 4)
    record = cell.session.to_json()
    tool = [list(row) for row in cell.truth["tool0_from_laser"]]
    tool[0][3] += off_mm
    record["cell"] |= {"known": {"tool0_from_laser": tool}, "verification": {"tool_mm": 1.0}}
    for capture in record["captures"]:
        capture["step"] = "verify"
    result = run(Session.model_validate(record), cell.files.__getitem__, "verify")["verify"]
    assert isinstance(result, VerifyResult)
    return result


def test_a_tool_that_the_user_brings_is_decided_on_by_the_limit() -> None:
    good, bad = verified(0.0), verified(2.0)
    assert (good.decision, good.verdict) == ("pass", "pass")
    assert (bad.decision, bad.verdict) == ("fail", "fail")
    assert "beyond the limit of 1 mm" in bad.warnings[0]
    assert bad.findings[0].code == "verify-fail"
    assert "more captures" not in " ".join(bad.warnings)  # a clear fail is no lack of captures
    assert bad.checks[0].value_mm == pytest.approx(2.0, abs=1.5 * bad.checks[0].uncertainty_mm)


def with_changes(*changes: dict[str, object]) -> VerifyResult:
    cell = simulate("tcp-centers", 4)
    record = cell.session.to_json()
    tool = [list(row) for row in cell.truth["tool0_from_laser"]]
    limits = {
        "tool_mm": 1.0,
        "changes": [{"at": "2026-11-23T00:10:00Z", "who": "K. Ito", **one} for one in changes],
    }
    record["cell"] |= {"known": {"tool0_from_laser": tool}, "verification": limits}
    for capture in record["captures"]:
        capture["step"] = "verify"
    result = run(Session.model_validate(record), cell.files.__getitem__, "verify")["verify"]
    assert isinstance(result, VerifyResult)
    return result


def test_a_limit_that_was_widened_after_captures_is_said_and_no_pass() -> None:
    widened = with_changes({"field": "tool_mm", "before_mm": 0.2, "after_mm": 1.0, "captures": 4})
    said = "The limit of the tool's error at the sphere was changed after 4 captures: 0.2 → 1 mm."
    assert (widened.decision, widened.verdict) == ("pass", "warn")
    assert widened.warnings[0] == said
    assert widened.limits_changed == [said]
    decision, *_ = widened.evidence
    assert getattr(decision, "remark", None) == "by limits changed after the first capture"
    (table,) = (block for block in widened.evidence if getattr(block, "id", "") == "limit_changes")
    assert "K. Ito" in table.model_dump_json()
    late = with_changes({"field": "tool_mm", "after_mm": 1.0, "captures": 1})
    assert late.verdict == "warn"
    assert late.warnings[0].endswith("was set after 1 capture: 1 mm.")


def test_a_limit_that_was_narrowed_or_put_back_is_a_note() -> None:
    narrowed = with_changes({"field": "tool_mm", "before_mm": 2.0, "after_mm": 1.0, "captures": 4})
    back = with_changes(
        {"field": "tool_mm", "before_mm": 1.0, "after_mm": 3.0, "captures": 4},
        {"field": "tool_mm", "before_mm": 3.0, "after_mm": 1.0, "captures": 9},
    )
    assert (narrowed.verdict, len(narrowed.notes)) == ("pass", 1)
    assert (back.verdict, len(back.notes), back.limits_changed) == ("pass", 2, back.notes)


def on_a_ball_bar(off_mm: float, calibrated_off_mm: float = 0.0, alone: bool = False) -> VerifyResult:
    """Verify with captures of two spheres 300 mm apart, the scanner `off_mm` from where the tool says."""
    cell = simulate("tcp-centers", 4)
    record = cell.session.to_json()
    tool = np.array(cell.truth["tool0_from_laser"])
    limits = {"ball_bar_mm": 300.0 + calibrated_off_mm, "ball_bar_sigma_mm": 0.005, "spacing_mm": 0.5}
    told = tool.copy()
    told[0, 3] += off_mm
    record["cell"] |= {"known": {"tool0_from_laser": told.tolist()}, "verification": limits}
    way = np.array([180.0, 240.0, 0.0])
    for number, capture in enumerate(record["captures"]):
        capture |= {"step": "verify", "mount": "A"}
        if number == 1 if alone else number % 2:
            pose = parse_pose(record["cell"]["pose_convention"], capture["pose"])
            moved = RigidTransform.of(pose.rotation, pose.translation_mm + way, "base", "tool0")
            capture |= {"pose": to_pose(record["cell"]["pose_convention"], moved), "mount": "B"}
    result = run(Session.model_validate(record), cell.files.__getitem__, "verify")["verify"]
    assert isinstance(result, VerifyResult)
    return result


def test_the_spacing_of_a_ball_bars_spheres() -> None:
    good = next(check for check in on_a_ball_bar(0.0).checks if check.name == "spacing")
    assert abs(good.value_mm) < 1.5 * good.uncertainty_mm
    assert 0.01 < good.uncertainty_mm < 0.2
    assert good.decision == "pass"
    bad = on_a_ball_bar(0.0, calibrated_off_mm=1.0)
    spacing = next(check for check in bad.checks if check.name == "spacing")
    assert spacing.value_mm == pytest.approx(-1.0, abs=1.5 * spacing.uncertainty_mm)
    assert bad.decision == "fail"
    # Each sphere is judged about its own centre: the spheres' distance is no scatter.
    assert bad.held_out_scatter_rms_mm < 1.0
    assert len([row for row in bad.residuals if row.used]) == 14


def test_one_capture_of_a_ball_bars_sphere_is_left_out_and_the_rest_judged() -> None:
    result, whole = on_a_ball_bar(0.0, alone=True), on_a_ball_bar(0.0)
    (said,) = (one for one in result.findings if one.code == "verify-seen-once")
    (row,) = (row for row in result.residuals if not row.used)
    assert said.captures == [row.capture]
    assert "only capture of the sphere" in str(said.text)
    assert "the only capture of" in str(row.reason)
    tool, of_both = (next(c for c in one.checks if c.name == "tool") for one in (result, whole))
    assert tool.value_mm == pytest.approx(of_both.value_mm, abs=2 * tool.uncertainty_mm)
    assert not any(check.name == "spacing" for check in result.checks)  # of one sphere there is none


def test_two_spheres_with_one_capture_each_are_too_few() -> None:
    cell = simulate("tcp-centers", 4)
    record = cell.session.to_json()
    record["cell"] |= {"known": {"tool0_from_laser": cell.truth["tool0_from_laser"]}}
    record["captures"] = [
        {**capture, "step": "verify", "mount": mount}
        for capture, mount in zip(record["captures"][:2], ("a", "b"), strict=True)
    ]
    with pytest.raises(MotionError, match="captures of each sphere"):
        run(Session.model_validate(record), cell.files.__getitem__, "verify")


def test_the_spacing_takes_nothing_of_the_arm_for_what_an_exact_tool_has_swallowed() -> None:
    cell = simulate("verify", 7)  # its covariance had negative eigenvalues
    result = run(cell.session, cell.files.__getitem__, "verify")["verify"]
    assert isinstance(result, VerifyResult)
    spacing = next(check for check in result.checks if check.name == "spacing")
    assert abs(spacing.value_mm) < 1.5 * spacing.uncertainty_mm


def test_a_limit_that_the_captures_cannot_be_held_to_is_no_pass() -> None:
    cell = simulate("tcp-centers", 4)  # centres: no points of the surface, and one sphere
    record = cell.session.to_json()
    limits = {"tool_mm": 5.0, "form_mm": 0.2, "spacing_mm": 0.5}
    record["cell"] |= {"known": {"tool0_from_laser": cell.truth["tool0_from_laser"]}, "verification": limits}
    for capture in record["captures"]:
        capture["step"] = "verify"
    result = run(Session.model_validate(record), cell.files.__getitem__, "verify")["verify"]
    assert result.verdict == "warn"
    assert any("Probing form: the limit of 0.2 mm was not checked" in said for said in result.warnings)
    assert any("Sphere spacing: the limit of 0.5 mm was not checked" in said for said in result.warnings)


def test_two_captures_decide_nothing() -> None:
    result = solved(verified_session(3, of_sphere=2, limits={"tool_mm": 2.0}))["verify"]
    assert (result["decision"], result["verdict"]) == ("undecided", "warn")
    assert "verify-undecided" in {one["code"] for one in result["findings"]}


@pytest.mark.thorough
def test_captures_that_calibrated_do_not_verify() -> None:
    made = verified_session(3)
    own = [c for c in made.session.captures if c.step == "tcp"]
    copies = [c.model_copy(update={"id": f"w{k}", "step": "verify"}) for k, c in enumerate(own[:8])]
    held_out = [c for c in made.session.captures if c.step == "verify"]
    # The same files alone; then the same poses with files of their own.
    session = made.session.model_copy(update={"captures": [*own, *copies]})
    result = solved(replace(made, session=session))["verify"]
    assert (result["decision"], result["verdict"]) == ("undecided", "warn")
    (said,) = (one for one in result["findings"] if one["code"] == "verify-not-held-out")
    assert said["captures"] == [c.id for c in copies]
    assert [row["used"] for row in result["residuals"]] == [False] * 8
    there = [c.model_copy(update={"pose": own[k].pose}) if k < 2 else c for k, c in enumerate(held_out)]
    session = made.session.model_copy(update={"captures": [*own, *there]})
    result = solved(replace(made, session=session))["verify"]
    (said,) = (one for one in result["findings"] if one["code"] == "verify-not-held-out")
    assert (said["captures"], said["values"]["same"]) == ([c.id for c in held_out[:2]], "poses")
    assert sum(row["used"] for row in result["residuals"]) == 12


def test_points_of_the_calibration_that_were_saved_anew_do_not_verify() -> None:
    made = verified_session(3)
    own = [c for c in made.session.captures if c.step == "tcp"]
    held_out = [c for c in made.session.captures if c.step == "verify"]
    files = {f"again/{c.id}.csv": made.files[c.files[0]] + b"\n" for c in own[:2]}
    again = [
        shifted(
            made.session, c.model_copy(update={"id": f"w{k}", "step": "verify", "files": [name]}), [2.0, 0.0, 0.0]
        )
        for k, (c, name) in enumerate(zip(own, files, strict=False))
    ]
    session = made.session.model_copy(update={"captures": [*own, *again, *held_out]})
    result = solved(replace(made, session=session, files={**made.files, **files}))["verify"]
    (said,) = (one for one in result["findings"] if one["code"] == "verify-not-held-out")
    assert (said["captures"], said["values"]["same"]) == (["w0", "w1"], "points")


def test_the_one_wrong_pose_is_named() -> None:
    made = verified_session(5)
    wrong = made.session.captures[-3]
    captures = [shifted(made.session, c, [0.7, 0.7, 0.0]) if c is wrong else c for c in made.session.captures]
    result = solved(replace(made, session=made.session.model_copy(update={"captures": captures})))["verify"]
    (said,) = (one for one in result["findings"] if one["code"] == "verify-captures-disagree")
    assert said["captures"] == [wrong.id]
    assert result["verdict"] != "pass"


@pytest.mark.thorough
def test_figures_of_signing_hold_on_a_few() -> None:
    rows = [*bench_sign.decisions(24), *bench_sign.wrong_poses((1.0, 5.0), 4, 8)]
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows if not r.holds] == []


def test_captures_that_repeat_a_pose_tell_what_the_cell_is_capable_of() -> None:
    options = replace(VERIFY_SCENARIOS["verify"], of_sphere=6, of_bar=0, of_plate=0, limits={"tool_mm": 0.4})
    made = simulate_verify(3, options)
    first = next(one for one in made.session.captures if one.step == "verify")
    again = [retake(made, first.id, f"again{k}", 100 + k) for k in range(4)]
    own = [one.model_copy(update={"step": first.step, "mount": first.mount}) for one, _ in again]
    files = dict(made.files)
    for _, content in again:
        files |= content
    names = {first.id, *(one.id for one in own)}

    captures = [*made.session.captures, *own]
    session = made.session.model_copy(update={"captures": captures})
    result = run(session, files.__getitem__, "verify")["verify"]
    assert isinstance(result, VerifyResult)
    (table,) = (one for one in result.evidence if isinstance(one, Table) and one.id == "capability")
    assert "5 captures that repeat a pose (poses: 1)" in table.caption
    assert "± 0.4 mm" in table.caption
    offsets = np.array([row.center_offset_in_base_mm for row in result.residuals if row.capture in names])
    spread = offsets.std(axis=0, ddof=1).max()
    (error,) = (check.value_mm for check in result.checks if check.name == "tool")
    told = [cell.value for cell in table.rows[0].cells if isinstance(cell, Quantity)]
    assert told == pytest.approx([spread, error, 0.16 / (6 * spread), (0.08 - error) / (3 * spread)])
    # One of another angle of a table is no repeat, nor are two captures alone enough.
    turned = [one.model_copy(update={"table_deg": 10.0 * k}) for k, one in enumerate(own)]
    for some in (turned, own[:1]):
        others = made.session.model_copy(update={"captures": [*made.session.captures, *some]})
        assert not capability_of_captures(others, result)


def test_a_capture_that_is_left_out_keeps_its_row_and_the_others_theirs() -> None:
    made = simulate("verify", 3)
    whole = solve_stage(made.session, "verify", made.files.__getitem__)
    names = [row.capture for row in whole.residuals]
    record = made.session.to_json()
    for capture in record["captures"]:
        capture["excluded"] = capture["id"] == names[1]
    fewer = solve_stage(parse_session(record), "verify", made.files.__getitem__)
    assert [row.capture for row in fewer.residuals] == names
    assert [row.capture for row in fewer.residuals if not row.used] == [names[1]]
