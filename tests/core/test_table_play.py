"""Play of the table that is taken up from one side: said as not checked until an angle is captured again."""

from itertools import count

import numpy as np
import pytest

from calib_core.findings import has, verdict_of
from calib_core.findings.codes.turntable import PLAY_NOT_CHECKED
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.play import play_findings
from calib_core.stages.turntable.record import TurntableResult
from tests.trouble import TableTrouble, troubled

ANGLES_DEG = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0, 0.0)


def solved(play_deg: float) -> TurntableResult:
    """Return the turntable of a cell whose table came to zero from the other side at the end of each mounting."""

    def change(plan, rng):
        stops = count(1)
        plan.angles_deg = ANGLES_DEG
        plan.encoder = lambda angle, rng: (
            angle + (np.deg2rad(play_deg) if next(stops) % len(ANGLES_DEG) == 0 else 0.0)
        )

    cell = troubled(TableTrouble("play", change), 1)
    result = solve_stage(cell.session, "turntable", cell.files.__getitem__)
    assert isinstance(result, TurntableResult)
    return result


@pytest.fixture(scope="module")
def without_play() -> TurntableResult:
    return solved(0.0)


def test_an_angle_captured_again_takes_the_place_of_not_checked(without_play: TurntableResult) -> None:
    assert without_play.verdict == "pass", without_play.warnings
    [note] = [note for note in without_play.notes if "Angles captured again" in note]
    assert "t000 and t006" in note or "t007 and t013" in note
    assert not has(without_play.findings, PLAY_NOT_CHECKED)


def test_without_one_it_is_said_as_not_checked(without_play: TurntableResult) -> None:
    once = [row for row in without_play.residuals if row.capture not in ("t006", "t013")]
    found = play_findings(without_play.model_copy(update={"residuals": once}))
    assert [finding.code for finding in found] == [PLAY_NOT_CHECKED.name]


def test_an_angle_captured_from_the_other_side_shows_the_play(without_play: TurntableResult) -> None:
    turned = [
        row.model_copy(update={"angle_deg": row.angle_deg + 0.3}) if row.capture == "t006" else row
        for row in without_play.residuals
    ]
    found = play_findings(without_play.model_copy(update={"residuals": turned}))
    assert verdict_of(found) == "warn"
    assert "t000 and t006 are one angle of the table" in found[-1].text


def test_play_of_a_whole_session_is_no_pass() -> None:
    found = solved(0.3)
    assert found.verdict == "warn", found.notes
    assert any("play" in sentence for sentence in found.warnings), found.warnings
