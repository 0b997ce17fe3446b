"""Turntables with what goes wrong in real cells: are stage and chain true in what they state, is no `pass` false?

For each class and each of the stages turntable and chain: verdicts, and how far table and, of the chain, tool are
off in units of their stated 95 %.
"""

import numpy as np
from bench_trouble import OTHERS, SUMS, Outcome, counts_of, sums
from bench_trouble import errors_over_stated as errors_of_scanners
from harness import Row

from calib_core.errors import CalibrationError
from calib_core.frames import RigidTransform
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.record import TurntableResult
from tests.trouble import TableTrouble, Troubled, all_table_troubles, troubled
from tests.trouble.cell import Scanners

STAGES = ("turntable", "chain")
_FREE = [0, 1, 3, 4, 5]  # T's rotation about its own z follows from the tilts


def outcome(
    trouble: TableTrouble, seed: int, told: bool = False, scanners: Scanners = "one"
) -> dict[str, Outcome]:
    """Return what each stage makes of one session."""
    cell = troubled(trouble, seed, told, scanners)
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


def errors_over_stated(result: TurntableResult | ChainResult, cell: Troubled) -> np.ndarray:
    """Return the errors of the table's five numbers and of the chain's scanners, over half of their 95 %."""
    table = RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable")
    assert cell.base_from_turntable is not None
    truth = RigidTransform.from_rounded(cell.base_from_turntable, "base", "turntable")
    alone = isinstance(result, TurntableResult)
    covariance = np.array(result.covariance if alone else result.turntable_covariance)
    errors = np.abs(truth.difference(table)[_FREE]) / (1.96 * np.sqrt(np.diag(covariance)[_FREE]))
    return errors if alone else np.concatenate([errors, errors_of_scanners(result, cell)])


def run(full: bool) -> list[Row]:
    """Return a row a class and the sums, nothing told and the makers' sigmas told; `full` takes 20 seeds.

    Of other cells, which have two seeds or one, the sums alone.
    """
    seeds = range(20 if full else 2)
    others = [row for one in OTHERS for row in rows_of(range(1 + full), False, one)[-SUMS:]]
    return [*(row for told in (False, True) for row in rows_of(seeds, told)), *others]


def rows_of(seeds: range, told: bool, scanners: Scanners = "one") -> list[Row]:
    rows: list[Row] = []
    shown: list[Outcome] = []
    clean: list[Outcome] = []
    what = ("sigmas told" if told else "nothing told") + OTHERS.get(scanners, "")
    for name, trouble in all_table_troubles().items():
        outcomes = [outcome(trouble, seed, told, scanners) for seed in seeds]
        for stage in STAGES:
            own = [each[stage] for each in outcomes]
            shown += [] if trouble.is_hidden(scanners) else own
            clean += own if trouble.clean else []
            rows.append(Row(f"{stage}, {name}, {what}", "must pass" if trouble.clean else "", counts_of(own)))
    return [*rows, *sums(shown, clean, what)]
