"""Cells of any topology are solved within what is stated, or say what is open; and are used like any other."""

from pathlib import Path

import hypothesis as hy
import pytest

from calib_core.simulation import TcpScenario, TopologyScenario
from calib_core.simulation.topology import AxisOptions
from tests.topologies import topologies
from tests.topology_use import put_to_use


@pytest.mark.thorough
@hy.settings(
    max_examples=4,
    deadline=None,
    database=None,
    derandomize=True,
    phases=[hy.Phase.generate],
    suppress_health_check=[*hy.HealthCheck],
)
@hy.given(topologies())
def test_a_drawn_cell_is_solved_or_says_what_is_open(
    tmp_path_factory: pytest.TempPathFactory, scenario: TopologyScenario
) -> None:
    folder: Path = tmp_path_factory.mktemp("drawn")
    assert not put_to_use(scenario, 1, folder).startswith("wrong")


@pytest.mark.thorough
def test_patches_that_pair_best_a_thousandth_as_far_away_are_merged_all_the_same(tmp_path: Path) -> None:
    leaned = AxisOptions("leaned", "rotary", "robot", None, (1.0, 0.0, 0.0), low=-40.0, high=40.0)
    cell = TopologyScenario("", axes=(leaned,), cell=TcpScenario(window_x_mm=100.0), told="distances")
    assert put_to_use(cell, 8215, tmp_path) == "solved"  # poses in micrometres were tried, and had no words
