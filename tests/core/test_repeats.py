"""A pose taken again after the arm had been elsewhere: what it says of lag and play; the guide asks for it."""

from io import StringIO

import numpy as np
import pytest

from calib_core.chain.observations import SphereObservation
from calib_core.chain.repeated import repeats
from calib_core.findings import has
from calib_core.findings.codes.arm import LAG_NOT_CHECKED
from calib_core.frames import RigidTransform
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.reviewed import ASK_FOR_REPEAT, review
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import Trouble, troubled
from tests.trouble.cell import profile_csv

CLEAN = Trouble("clean", lambda plan, rng: None)


def seen(name: str, at_mm: float, center_mm: tuple[float, float, float]) -> SphereObservation:
    flange = RigidTransform.of(np.eye(3), np.array([at_mm, 0.0, 0.0]), "base", "tool0")
    return SphereObservation(name, flange, "cloud", np.zeros((0, 3)), np.array(center_mm), 1e-6 * np.eye(3))


def test_only_poses_that_the_arm_had_left_count() -> None:
    still = [seen("a", 0, (0, 0, 200)), seen("b", 0, (0.3, 0, 200)), seen("c", 50, (0, 0, 200))]
    assert repeats(still) == []  # b was taken without going elsewhere
    (again,) = repeats([*still, seen("d", 0.02, (0.3, 0, 200.4))])
    assert (again.first, again.again) == ("a", "d")
    assert again.shift_mm == pytest.approx(0.5)
    assert again.is_shift


def solved(lag_mm: float) -> TcpResult:
    """The clean cell, its fifth pose taken once more at the end, the arm then `lag_mm` short along the stripe."""
    clean = troubled(CLEAN, 0)
    points = np.loadtxt(StringIO(clean.files["captures/p004.csv"].decode()), delimiter=",", skiprows=1)
    points += np.array([lag_mm, 0.0]) + np.random.default_rng(5).normal(0, 0.01, points.shape)
    record = clean.session.to_json()
    record["captures"].append({**record["captures"][4], "id": "again", "files": ["captures/again.csv"]})
    files = {**clean.files, "captures/again.csv": profile_csv(points)}
    result = solve_stage(type(clean.session).model_validate(record), "tcp", files.__getitem__)
    assert isinstance(result, TcpResult)
    return result


def test_a_repeat_that_agrees_takes_the_place_of_not_checked() -> None:
    result = solved(0.0)
    assert result.verdict == "pass", result.warnings
    assert not has(result.findings, LAG_NOT_CHECKED)
    assert any(note.startswith("Poses taken again") and "p004 and again" in note for note in result.notes)
    assert ASK_FOR_REPEAT not in review(result.to_json()).why


def test_a_repeat_from_the_other_side_shows_a_lag() -> None:
    result = solved(0.4)
    assert result.verdict == "warn"
    assert any("p004 and again are one pose, reached twice" in sentence for sentence in result.warnings)


def test_without_a_repeat_the_verdict_says_not_checked_and_the_guide_asks() -> None:
    clean = troubled(CLEAN, 0)
    result = solve_stage(clean.session, "tcp", clean.files.__getitem__)
    assert has(result.findings, LAG_NOT_CHECKED)
    assert guide(clean.session, [], {"tcp": result.to_json()}).current.why.endswith(ASK_FOR_REPEAT)
