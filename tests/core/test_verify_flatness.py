"""Flatness of a plate as a figure of the verification, against plates whose form is known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.records import Measured, Session
from calib_core.simulation import VERIFY_SCENARIOS, SimulatedSession, simulate_verify
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import run
from calib_core.stages.verify.flatness import flatness
from calib_core.stages.verify.record import VerifyCheck, VerifyResult

_BROUGHT = replace(VERIFY_SCENARIOS["verify"], tool_off_mm=0.0, of_bar=0)


def verified(session: Session, files: dict[str, bytes]) -> VerifyResult:
    result = run(session, files.__getitem__, "verify")["verify"]
    assert isinstance(result, VerifyResult)
    return result


def figure(result: VerifyResult, name: str = "flatness") -> VerifyCheck:
    return next(check for check in result.checks if check.name == name)


@cache
def cell(bow_mm: float = 0.0) -> SimulatedSession:
    """Simulate a cell that brings its true tool, with a plate."""
    return simulate_verify(3, replace(_BROUGHT, bow_mm=bow_mm))


@pytest.mark.thorough
def test_a_flat_plate_passes_and_a_bowed_one_is_found() -> None:
    flat, bowed = (verified(c.session, c.files) for c in (cell(), cell(4.0)))
    assert figure(flat).decision == "pass"
    assert flat.decision == "undecided"  # the ball bar's limit is set, and no bar was captured
    assert len(flat.warnings) == 1
    assert "Sphere spacing: the limit of 1.5 mm was not checked" in flat.warnings[0]
    # Points scatter by 0.02 mm and poses by 0.05 mm: a range of many is some sigmas wide.
    assert 0.1 < figure(flat).value_mm < 0.6
    assert figure(flat, "flatness_95").value_mm < figure(flat).value_mm
    assert (figure(bowed).decision, bowed.verdict) == ("fail", "fail")
    assert figure(bowed).value_mm == pytest.approx(4.0, abs=figure(bowed).uncertainty_mm)


def test_a_wrong_tool_bends_the_plate() -> None:
    wrong = simulate_verify(3, replace(_BROUGHT, tool_off_mm=6.0))
    found = verified(wrong.session, wrong.files)
    flat = figure(found)
    assert flat.value_mm > 1.0 + flat.uncertainty_mm
    # By the rule nothing is decided where U is above the limit; the tool's error at the sphere decides.
    assert (flat.uncertainty_mm > 1.0, flat.decision) == (True, "undecided")
    assert (figure(found, "tool").decision, found.decision, found.verdict) == ("fail", "fail", "fail")


def test_what_is_beside_the_plate_is_left_out_and_a_capture_of_something_else_too() -> None:
    files = dict(cell().files)
    lines = files["captures/f02.csv"].decode().splitlines()
    told = [n for n, line in enumerate(lines) if n and not line.endswith(",")]
    for n in told[:40]:  # a clamp on the plate
        x, z = lines[n].split(",")
        lines[n] = f"{x},{float(z) - 15.0:.4f}"
    files["captures/f02.csv"] = ("\n".join(lines) + "\n").encode()
    lines = files["captures/f05.csv"].decode().splitlines()
    for n in range(1, len(lines)):  # the table below it
        x, z = lines[n].split(",")
        lines[n] = f"{x},{float(z) + 40.0:.4f}" if z else lines[n]
    files["captures/f05.csv"] = ("\n".join(lines) + "\n").encode()
    found = verified(cell().session, files)
    assert figure(found).decision == "pass"
    assert found.notes == [
        f"{40 + len(told_of(lines))} points beside the plate's plane were left out of its flatness."
    ]
    assert [(row.capture, row.used) for row in found.residuals if not row.used] == [("f05", False)]


def told_of(lines: list[str]) -> list[str]:
    return [line for line in lines[1:] if not line.endswith(",")]


def test_too_few_captures_of_the_plate_are_no_pass() -> None:
    record = cell().session.to_json()
    kept = [c for c in record["captures"] if c["step"] != "plate" or c["id"] in ("f01", "f02", "f03")]
    found = verified(Session.model_validate({**record, "captures": kept}), cell().files)
    assert found.verdict == "warn"
    assert any("Flatness: the limit of 1 mm was not checked" in said for said in found.warnings)
    assert any("there are 3" in said for said in found.warnings)


def test_captures_of_one_orientation_are_doubted() -> None:
    one_way = [np.array([0.1 * k, 0.0, 0.0]) + np.random.default_rng(k).normal(0, 1, (9, 3)) for k in range(4)]
    assert flatness(one_way)[0].value_mm > 0
    record = cell().session.to_json()
    first = next(c for c in record["captures"] if c["id"] == "f01")
    for number, capture in enumerate(c for c in record["captures"] if c["step"] == "plate"):
        capture |= {"files": first["files"], "pose": [*first["pose"]]}
        capture["pose"][1] += 10.0 * number
    found = verified(Session.model_validate(record), cell().files)
    assert any("within 0° of one orientation" in said for said in found.warnings)


@pytest.mark.parametrize(("limits", "step"), [({"flatness_mm": 0.5}, "plate"), ({"tool_mm": 0.5}, "verify")])
def test_the_guide_asks_for_a_plate_only_where_a_limit_is_set(limits: dict[str, float], step: str) -> None:
    record = cell().session.to_json()
    record["cell"]["verification"] = limits
    record["captures"] = [c for c in record["captures"] if c["step"] == "verify"]
    session = Session.model_validate(record)
    measured = [Measured(capture=c.id, kind="profile", verdict="pass") for c in session.captures]
    now = guide(session, measured, {}).current
    assert (now.step, now.stage) == (step, "verify")
    assert now.action == ("capture" if step == "plate" else "solve")


def test_a_plate_alone_is_decided_by_its_flatness() -> None:
    def alone(cell: SimulatedSession, few: bool = False, **limits: float | None) -> VerifyResult:
        record = cell.session.to_json()
        kept = [c for c in record["captures"] if c["step"] == "plate"]
        told = {"verification": {"flatness_mm": 1.0} | limits}
        record = {**record, "cell": record["cell"] | told, "captures": kept[:3] if few else kept}
        return verified(Session.model_validate(record), cell.files)

    flat, bowed = alone(cell()), alone(cell(4.0))
    assert (flat.decision, flat.verdict, bowed.decision, bowed.verdict) == ("pass", "pass", "fail", "fail")
    assert [check.name for check in flat.checks] == ["flatness", "flatness_95"]
    assert (flat.held_out_scatter_rms_mm, flat.sphere_center_in_base_mm) == (None, None)
    assert "how far the tool is off at a sphere was not looked at" in flat.notes[0]
    assert "Flatness" in str(flat)
    both = alone(cell(), tool_mm=0.5)
    assert (both.decision, both.verdict) == ("undecided", "warn")
    assert any("Tool's error at the sphere: the limit of 0.5 mm was not checked" in said for said in both.warnings)
    without = alone(cell(), flatness_mm=None)
    assert (without.decision, without.verdict) == (None, "warn")
    assert "No limit of the flatness is set" in without.warnings[0]
    record = cell().session.to_json()
    begun = [c for c in record["captures"] if c["step"] == "plate"]
    told = {**record, "cell": record["cell"] | {"verification": {"flatness_mm": 1.0}}}
    asked = [
        guide(Session.model_validate({**told, "captures": begun[:n]}), [], {}).current for n in (3, len(begun))
    ]
    assert [(now.step, now.action) for now in asked] == [("plate", "capture"), ("verify", "solve")]
    with pytest.raises(MotionError, match="captures of the plate that can be used"):
        alone(cell(), few=True)
