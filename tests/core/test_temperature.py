"""A sphere that is warm: its diameter at the captures' temperature, and what a result says of it."""

import numpy as np
import pytest

from calib_core.graph.keys import Graph
from calib_core.graph.temperature import at_temperature
from calib_core.records import Session, parse_session
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage

STEEL_PER_K = 11.5e-6
CELL = simulate("tcp", 3)
STEPS = ("tcp",)


def session_at(ball_c: float | None, told_mm: float, *, of_captures: bool = False, **piece: object) -> Session:
    """Return the simulated session with a sphere that was certified so large, at a temperature."""
    record = CELL.session.to_json()
    record["cell"] |= {"sphere_diameter_mm": told_mm, "equipment": [{"kind": "sphere", **piece}]}
    if ball_c is not None and of_captures:
        record["captures"] = [one | {"environment": {"ball_c": ball_c}} for one in record["captures"]]
    elif ball_c is not None:
        record["environment"] = {"ball_c": ball_c}
    return parse_session(record, "session")


@pytest.mark.parametrize("of_captures", [False, True])
@pytest.mark.parametrize(("ball_c", "reference_c"), [(30.0, None), (12.5, None), (30.0, 23.0)])
def test_a_warm_sphere_gives_the_answer_of_a_cold_one(
    ball_c: float, reference_c: float | None, of_captures: bool
) -> None:
    """What the simulator scanned was as large as at `ball_c`; the certificate holds at its own temperature."""
    true_mm = CELL.session.cell.sphere_diameter_mm
    assert true_mm is not None
    certified_mm = true_mm / (1 + STEEL_PER_K * (ball_c - (20.0 if reference_c is None else reference_c)))
    piece = {"expansion_per_k": STEEL_PER_K} | ({} if reference_c is None else {"reference_c": reference_c})
    told = solve_stage(
        session_at(ball_c, certified_mm, of_captures=of_captures, **piece), "tcp", CELL.files.__getitem__
    ).to_json()
    plain = solve_stage(CELL.session, "tcp", CELL.files.__getitem__).to_json()
    np.testing.assert_allclose(told["tool0_from_laser"], plain["tool0_from_laser"], atol=2e-3)
    (note,) = [one for one in told["findings"] if one["code"] == "length-at-temperature"]
    assert note["severity"] == "note"
    assert note["values"]["length_mm"] == pytest.approx(true_mm, abs=1e-9)
    assert note["values"]["change_um"] == pytest.approx(1e3 * (true_mm - certified_mm))
    assert told["verdict"] == plain["verdict"] == "pass"


def test_what_the_temperature_adds_to_the_uncertainty() -> None:
    """10 K on 80 mm of steel: 9.2 µm, of which the expansion's ± 10 % are 0.53 µm, half a kelvin 0.46 µm."""
    session = session_at(30.0, 80.0, expansion_per_k=STEEL_PER_K)
    cell = session.cell.model_copy(update={"sphere_diameter_sigma_mm": 0.001})
    warm = at_temperature(session.model_copy(update={"cell": cell}), STEPS).cell
    assert warm.sphere_diameter_mm == pytest.approx(80.0092)
    assert warm.sphere_diameter_sigma_mm == pytest.approx(1e-3 * np.sqrt(1 + 0.531**2 + 0.46**2), rel=1e-3)


def test_captures_of_other_steps_change_no_key() -> None:
    session = session_at(24.0, 80.0, of_captures=True, expansion_per_k=STEEL_PER_K)
    before = Graph(session, lambda name: name).key("tcp")
    record = session.to_json()
    record["captures"].append(
        record["captures"][0] | {"id": "v01", "step": "verify", "environment": {"ball_c": 31}}
    )
    assert Graph(parse_session(record, "session"), lambda name: name).key("tcp") == before
    record["captures"][0]["environment"] = {"ball_c": 25.0}
    assert Graph(parse_session(record, "session"), lambda name: name).key("tcp") != before


@pytest.mark.thorough
def test_without_an_expansion_the_diameter_stays_and_the_result_says_so() -> None:
    session = session_at(30.0, 80.0, serial="K 17")
    assert at_temperature(session, STEPS) is session
    result = solve_stage(session, "tcp", CELL.files.__getitem__)
    assert [one.code for one in result.findings if one.code == "expansion-unknown"] == ["expansion-unknown"]


def test_nothing_told_changes_nothing() -> None:
    assert at_temperature(CELL.session, STEPS) is CELL.session
    assert (
        at_temperature(session_at(None, 80.0, expansion_per_k=STEEL_PER_K), STEPS).cell.sphere_diameter_mm == 80.0
    )
