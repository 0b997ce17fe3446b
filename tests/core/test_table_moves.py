"""A table, or a sphere on it, that moves while it is captured is told: `scancell bench table_moves` has many."""

import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.record import TurntableResult
from tests.trouble import TableTrouble, all_table_troubles, troubled
from tests.trouble.table_cell import TablePlan

MOVES = {"table-pushed", "table-creeps", "sphere-reseated", "clamp-gives"}


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("when", ["between the mountings", "within a mounting"])
def test_a_table_that_was_pushed_is_said(when: str) -> None:
    cell = troubled(all_table_troubles()[f"pushed by 1 mm {when}"], 0)
    result = solve_stage(cell.session, "chain", cell.files.__getitem__)
    assert result.verdict == "warn"  # pushes passed up to 3.6 times off
    assert [f.code for f in result.findings if f.code in MOVES] == ["table-pushed"]


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("seed", [12, 1])
def test_the_few_captures_before_or_after_a_push_are_heard(seed: int) -> None:
    """Three and four captures were left out as of a sphere that was remounted, and the ± was of the others."""
    cell = troubled(all_table_troubles()["pushed by 1 mm within a mounting"], seed)
    result = solve_stage(cell.session, "turntable", cell.files.__getitem__)
    assert isinstance(result, TurntableResult)
    codes = {f.code for f in result.findings}
    assert "table-pushed" in codes
    assert not codes & {"sphere-remounted", "table-captures-contradict"}
    truth = RigidTransform.from_rounded(cell.base_from_turntable, "base", "turntable")
    off = truth.difference(RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable"))
    # Without the rotation about the table's own axis: by 9.1 times the stated 95 % before.
    free = [0, 1, 3, 4, 5]
    assert np.max(np.abs(off[free]) / (1.96 * np.sqrt(np.diag(np.array(result.covariance))[free]))) < 1.5


@pytest.mark.thorough
def test_a_sphere_that_slips_far_is_left_out_as_before() -> None:
    cell = troubled(all_table_troubles()["sphere slips by 3 mm"], 0)
    result = solve_stage(cell.session, "turntable", cell.files.__getitem__)
    assert "sphere-remounted" in {f.code for f in result.findings}
    assert "table-pushed" not in {f.code for f in result.findings}


TURNS_DEG = tuple(22.5 * k for k in range(16))


@pytest.mark.parametrize(("of", "said"), [("oval", []), ("push", ["table-pushed"])])
def test_a_way_that_is_an_oval_is_no_push(of: str, said: list[str]) -> None:
    """One turn at one height, as four of seven real positioners were captured that were said to be pushed."""

    def at(k: int, mount: int, count: int) -> np.ndarray:
        angle = np.deg2rad(TURNS_DEG[k])  # an arm or tracker whose scale differs by direction tells it so
        return np.array([np.cos(angle), -np.sin(angle), 0.0]) if of == "oval" else np.array([k >= 10, 0.0, 0.0])

    def change(plan: TablePlan, rng: np.random.Generator) -> None:
        plan.heights_mm, plan.angles_deg = (0.0,), TURNS_DEG
        plan.table_at = lambda k, mount, count: 0.6 * at(k, mount, count)

    cell = troubled(TableTrouble(of, change), 0)
    result = solve_stage(cell.session, "turntable", cell.files.__getitem__)
    assert [f.code for f in result.findings if f.code in MOVES] == said


@pytest.mark.thorough
def test_of_two_tables_the_one_that_was_pushed_is_said() -> None:
    simulated = simulate("two-tables", 1)
    captures = list(simulated.session.captures)
    since = [k for k, one in enumerate(captures) if one.mount == "two-high"]
    for k in since:  # the sphere is 1 mm further along base's x than the table's readings say
        x_mm, *rest = captures[k].pose or []
        captures[k] = captures[k].model_copy(update={"pose": [x_mm + 1.0, *rest]})
    session = simulated.session.model_copy(update={"captures": captures})
    result = solve_stage(session, "turntable", simulated.files.__getitem__)
    assert [(f.code, f.captures) for f in result.findings if f.code in MOVES] == [
        ("table-pushed", [captures[k].id for k in since])
    ]
