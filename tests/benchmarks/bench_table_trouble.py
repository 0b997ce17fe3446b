"""Turntables with what goes wrong in real cells: are stage and chain true in what they state, is no `pass` false?

For each class and each of the stages turntable and chain: verdicts, and how far table and, of the chain, tool are
off in units of their stated 95 %.
"""

import numpy as np
from bench_trouble import Outcome, counts_of, sums
from harness import Row

from calib_core.errors import CalibrationError
from calib_core.frames import RigidTransform
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.record import TurntableResult
from tests.trouble import TableTrouble, TroubledTable, all_table_troubles, troubled_table

STAGES = ("turntable", "chain")
_FREE = [0, 1, 3, 4, 5]  # T's rotation about its own z follows from the tilts


def outcome(trouble: TableTrouble, seed: int, told: bool = False) -> dict[str, Outcome]:
    """Return what each stage makes of one session."""
    cell = troubled_table(trouble, seed, told)
    found: dict[str, Outcome] = {}
    for stage in STAGES:
        try:
            result = solve_stage(cell.session, stage, cell.files.__getitem__)
        except CalibrationError as error:
            found[stage] = Outcome("refused", np.full(5, np.nan), [str(error)])
            continue
        assert isinstance(result, TurntableResult | ChainResult)
        found[stage] = Outcome(result.verdict, errors_over_stated(result, cell), result.warnings)
    return found


def errors_over_stated(result: TurntableResult | ChainResult, cell: TroubledTable) -> np.ndarray:
    """Return the errors of the table's five numbers and of the chain's tool, over half the width of their 95 %."""
    table = RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable")
    truth = RigidTransform.from_rounded(cell.base_from_turntable, "base", "turntable")
    alone = isinstance(result, TurntableResult)
    covariance = np.array(result.covariance if alone else result.turntable_covariance)
    errors = np.abs(truth.difference(table)[_FREE]) / (1.96 * np.sqrt(np.diag(covariance)[_FREE]))
    if alone:
        return errors
    tool = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    true_tool = RigidTransform.from_rounded(cell.tool0_from_laser, "tool0", "laser")
    six = np.abs(true_tool.difference(tool)) / (1.96 * np.sqrt(np.diag(np.array(result.covariance))))
    return np.concatenate([errors, six])


def run(full: bool) -> list[Row]:
    """Return a row a class and the sums, nothing told and the makers' sigmas told; `full` takes 20 seeds."""
    seeds = range(20 if full else 2)
    return [row for told in (False, True) for row in rows_of(seeds, told)]


def rows_of(seeds: range, told: bool) -> list[Row]:
    rows: list[Row] = []
    shown: list[Outcome] = []
    clean: list[Outcome] = []
    what = "sigmas told" if told else "nothing told"
    for name, trouble in all_table_troubles().items():
        outcomes = [outcome(trouble, seed, told) for seed in seeds]
        for stage in STAGES:
            own = [each[stage] for each in outcomes]
            shown += own
            clean += own if trouble.clean else []
            rows.append(Row(f"{stage}, {name}, {what}", "must pass" if trouble.clean else "", counts_of(own)))
    return [*rows, *sums(shown, clean, what)]
