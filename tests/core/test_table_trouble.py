"""What goes wrong with real turntables: no `pass` is far off.  20 seeds: `scancell bench table_trouble --full`."""

import numpy as np
import pytest
from bench_table_trouble import errors_over_stated, outcome

from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.record import TurntableResult
from tests.trouble import TableTrouble, all_table_troubles, troubled
from tests.trouble.cell import Scanners
from tests.trouble.table_cell import TablePlan

TROUBLES = all_table_troubles()


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("name", ["clean", "sphere slips by 3 mm", "two captures of the other mounting"])
def test_no_pass_is_far_off_and_a_clean_table_passes(name: str) -> None:
    for stage, found in outcome(TROUBLES[name], 0).items():
        if TROUBLES[name].clean:
            assert found.verdict == "pass", (stage, found.warnings)
        else:
            assert found.verdict != "pass", stage
        assert found.worst < 2, stage  # stated 95 % intervals


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("name", "word"),
    [("wobbles by 1 mrad three times a turn", "wobble"), ("encoder eccentric by 0.1°", "eccentric encoder")],
)
def test_what_repeats_with_the_angle_is_said(name: str, word: str) -> None:
    for stage, found in outcome(TROUBLES[name], 0).items():
        assert found.verdict == "warn", stage
        assert any(word in sentence for sentence in found.warnings), stage


@pytest.mark.thorough
def test_a_tool_that_moved_before_the_table_is_said_once() -> None:
    for stage, found in outcome(TROUBLES["tool moves by 1 mm, 0.3° before the table"], 5).items():
        assert found.verdict == "warn", stage  # it passed 5.2 times off while captures only seemed to scatter
        assert found.warnings[0].startswith("The captures on the table see the scanner"), found.warnings
        assert not any("two steps" in sentence for sentence in found.warnings), stage


@pytest.mark.thorough
def test_an_arm_that_errs_by_joints_gears_and_sag_is_covered() -> None:
    found = outcome(TROUBLES["joints, gears and sag"], 4)
    assert max(one.worst for one in found.values()) < 2  # 2.7 while shared position and orientation stood apart


@pytest.mark.thorough
def test_a_right_arm_that_is_less_true_than_it_repeats_passes_with_a_note() -> None:
    cell = troubled(TROUBLES["joints 0.01°, links 0.05 mm"], 0, told=True)
    result = solve_stage(cell.session, "chain", cell.files.__getitem__)
    assert result.verdict == "pass", result.warnings  # 0.05 mm where 0.03 mm were told, which the answer holds
    assert any(note.startswith("The captures agree to 0.05 mm where the robot's") for note in result.notes)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("stage", "seed"), [("turntable", 7), ("chain", 13)])
def test_a_tool_that_moved_by_less_than_is_beyond_chance_is_in_the_uncertainty(stage: str, seed: int) -> None:
    cell = troubled(TROUBLES["tool moves by 0.3 mm before the table"], seed)
    result = solve_stage(cell.session, stage, cell.files.__getitem__)
    assert isinstance(result, TurntableResult | ChainResult)
    # 2.3 and 3.2 while the table's captures were held to see the tool where the still sphere's do.
    assert errors_over_stated(result, cell).max() < 1.5


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("seed", [15, 6, 0])
def test_a_wobble_about_a_bearing_below_the_spheres_is_no_sphere_that_moved_and_in_the_uncertainty(
    seed: int,
) -> None:
    cell = troubled(TROUBLES["wobbles by 1 mrad twice a turn"], seed)
    for stage in ("turntable", "chain"):
        result = solve_stage(cell.session, stage, cell.files.__getitem__)
        assert isinstance(result, TurntableResult | ChainResult)
        found = {one.code for one in result.findings}
        # It passed, or a sphere was said to have moved, while the axis leaned about the first mounting's height.
        assert "axis-wobbles" in found
        assert "sphere-reseated" not in found
        assert errors_over_stated(result, cell).max() < 2  # 4.2 in the chain while the wobble added nothing to it


OF_OTHER_CELLS = [
    "repeats to 0.1 mm",
    "play of 0.02 mm",
    "play of 0.1 mm",
    "angles count the other way",
    "pushed by 1 mm between the mountings",
    "two captures of the other mounting",
]


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize("scanners", ["fixed", "two", "both"])
@pytest.mark.parametrize("name", OF_OTHER_CELLS)
def test_no_pass_is_far_off_with_a_scanner_that_stands_still_or_with_two(name: str, scanners: Scanners) -> None:
    for stage, found in outcome(TROUBLES[name], 0, scanners=scanners).items():
        if TROUBLES[name].clean:  # play was taken for a push, and for a scatter of the robot's
            assert found.verdict == "pass", (stage, found.warnings)
        else:
            assert found.verdict != "pass" or name == "play of 0.1 mm", stage
        assert found.worst < 2, stage  # 11 where nothing had play


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("after", [0, 6])
def test_a_scanner_that_stands_still_and_moved_is_told_by_the_ball_on_the_flange_after_the_table(
    after: int,
) -> None:
    def change(plan: TablePlan, rng: np.random.Generator) -> None:
        TROUBLES["tool moves by 1 mm, 0.3° before the table"].change(plan, rng)
        since, moved = plan.shifts + plan.tilts, plan.mounting
        plan.mounting = lambda k: moved(k + since if k >= since - after else k)

    cell = troubled(TableTrouble("moves", change), 0, scanners="fixed")
    captures = cell.session.captures
    held = [capture for capture in captures if capture.step == "tcp"]
    first = len(held) - after
    in_order = [*held[:first], *captures[len(held) :], *held[first:]]
    session = cell.session.model_copy(update={"captures": in_order})
    result = solve_stage(session, "chain", cell.files.__getitem__)
    codes = {one.code for one in result.findings}
    assert ("scanner-move-not-checked" in codes, "changed-tool" in codes) == (after == 0, after > 0)


@pytest.mark.thorough
def test_what_moved_a_table_is_in_its_uncertainty() -> None:
    for stage, found in outcome(TROUBLES["pushed by 1 mm between the mountings"], 1).items():
        assert found.verdict == "warn", stage
        assert found.worst < 2, stage
