"""A scanner that stands still is verified by a ball on the flange."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.library.opened import OpenSession
from calib_core.simulation import SCENARIOS, SimulatedSession, VerifyScenario, simulate_verify
from calib_core.stages.verify.record import VerifyResult

OPTIONS = VerifyScenario(
    tcp=SCENARIOS["fixed-scanner"], of_bar=0, of_plate=0, limits={"tool_mm": 2.0, "form_mm": 3.0}
)


def verified(made: SimulatedSession) -> VerifyResult:
    result = OpenSession(made.session, made.files.__getitem__).run()["verify"]
    assert isinstance(result, VerifyResult)
    return result


@pytest.mark.thorough
def test_a_right_fixed_scanner_passes_and_its_captures_scatter_as_expected() -> None:
    chances: list[float] = []
    for seed in (1, 2, 3):
        made = simulate_verify(seed, OPTIONS)
        result = verified(made)
        assert (result.verdict, result.decision) == ("pass", "pass"), result.findings
        assert result.tool0_from_laser is None
        assert result.base_from_laser is not None
        assert result.sphere_center_in_base_mm is None
        assert result.sphere_center_in_tool0_mm == pytest.approx(made.truth["sphere_center_in_tool0_mm"], abs=0.5)
        assert all(row.used for row in result.residuals)
        assert result.chance is not None
        chances.append(result.chance)
    assert max(chances) > 0.05


def test_a_fixed_scanner_that_is_off_fails() -> None:
    made = simulate_verify(1, OPTIONS)
    record = made.session.to_json()
    wrong = np.array(made.truth["base_from_laser"])
    wrong[:3, 3] += wrong[:3, :3] @ [0.0, 4.0, 0.0]
    record["cell"]["known"] = {"base_from_laser": wrong.tolist()}
    result = verified(replace(made, session=type(made.session).model_validate(record)))
    assert result.decision == "fail"
    (check,) = [check for check in result.checks if check.name == "tool"]
    assert check.value_mm == pytest.approx(4.0, abs=3 * check.uncertainty_mm)
