"""The answer for files and poses as they are: what is known of its errors is one step, `chain.held`."""

from typing import Any

import numpy as np
import pytest

from calib_core.chain import held as module
from calib_core.chain.held import Held, hold_files
from calib_core.chain.rejection import Judged
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import TableTrouble, Trouble, troubled
from tests.trouble.cell import Plan
from tests.trouble.table_cell import TablePlan


def held_chain(monkeypatch: pytest.MonkeyPatch, seed: int, depth_scale: float) -> tuple[Held, dict[str, Any]]:
    """Return how the chain of a cell whose scanner's depths are too short was held, and its result."""

    def change(plan: TablePlan, _: np.random.Generator) -> None:
        plan.scanner = lambda p, _: p - np.column_stack([0 * p[:, 0], depth_scale * p[:, 1]])

    made = troubled(TableTrouble("depths", change), seed, told=True)
    kept: list[Held] = []

    def keep(judged: Judged, apply: bool) -> Held:
        kept.append(hold_files(judged, apply))
        return kept[-1]

    monkeypatch.setattr("calib_core.chain.whole.hold_files", keep)
    result = solve_stage(made.session, "chain", made.files.__getitem__).to_json()
    return kept[-1], result | {"truth": made.true_base_from_turntable}


@pytest.mark.parametrize("seed", [3, 10])
def test_what_files_and_poses_put_off_is_one_step_and_not_two_that_add_in_squares(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    held, result = held_chain(monkeypatch, seed, 0.006)
    assert held.left is not None
    assert held.by_poses is not None  # the arm took a part of it, and gave it back
    whole = module._off(held.found, held.state, held.active, len(held.covariance))  # pyright: ignore[reportPrivateUsage]
    assert np.linalg.norm(held.known_off - whole) < 0.1 * np.linalg.norm(whole)
    place = held.data.walk.layout.axis_and_places(held.data.walk.layout.table)
    step, apart = np.abs(held.known_off[place]), np.abs(held.by_poses[place])
    assert step.max() < 0.5 * apart.max()  # in the table they undo each other
    without = held.covariance - np.outer(held.known_off, held.known_off)
    assert np.linalg.eigvalsh(without)[0] > -1e-9
    off = np.array(result["base_from_turntable"])[:3, 3] - result["truth"][:3, 3]
    sigmas = np.sqrt(np.diag(result["turntable_covariance"]))[3:]
    assert np.linalg.norm(off) < 3 * np.linalg.norm(sigmas)
    assert np.linalg.norm(sigmas) < 1.2


@pytest.mark.parametrize("seed", [3, 4])
def test_lengths_that_only_the_poses_as_told_need_are_not_held_against_the_workpiece(seed: int) -> None:
    """Depths half a per cent too long look like the arm's lengths once they stay in the files."""

    def sharp(plan: Plan, _: np.random.Generator) -> None:
        plan.shifts, plan.tilts, plan.position_mm, plan.orientation_rad = 10, 50, 0.01, 2e-5
        plan.scanner = lambda p, _: p * [1.0, 1.005]

    made = troubled(Trouble("depths", sharp), seed)
    result = solve_stage(made.session, "tcp", made.files.__getitem__)
    assert isinstance(result, TcpResult)
    assert result.workpiece is not None
    point = np.array(result.workpiece.point_in_laser_mm)
    found, truth = np.array(result.tool0_from_laser), made.tool0_from_laser
    off = found[:3, :3] @ (point * [1, 1, 1.005]) + found[:3, 3] - truth[:3, :3] @ point - truth[:3, 3]
    covariance = np.array(result.workpiece.covariance)
    assert off @ np.linalg.solve(covariance, off) < 7.81  # 95 % of three
    assert np.sqrt(np.linalg.eigvalsh(covariance)[-1]) < 2 * np.linalg.norm(off)
