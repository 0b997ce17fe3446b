"""What goes wrong with real turntables: no `pass` is far off.  20 seeds: `scancell bench table_trouble --full`."""

import pytest
from bench_table_trouble import outcome

from calib_core.simulation.trouble import all_table_troubles

TROUBLES = all_table_troubles()


@pytest.mark.parametrize("name", ["clean", "sphere slips by 3 mm", "two captures of the other mounting"])
def test_no_pass_is_far_off_and_a_clean_table_passes(name: str) -> None:
    for stage, found in outcome(TROUBLES[name], 0).items():
        if TROUBLES[name].clean:
            assert found.verdict == "pass", (stage, found.warnings)
        else:
            assert found.verdict != "pass", stage
        assert found.worst < 2, stage  # stated 95 % intervals


@pytest.mark.parametrize(
    ("name", "word"),
    [("wobbles by 1 mrad three times a turn", "wobble"), ("encoder eccentric by 0.1°", "eccentric encoder")],
)
def test_what_repeats_with_the_angle_is_said(name: str, word: str) -> None:
    for stage, found in outcome(TROUBLES[name], 0).items():
        assert found.verdict == "warn", stage
        assert any(word in sentence for sentence in found.warnings), stage
