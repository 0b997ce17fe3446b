"""Sessions with what goes wrong in real cells: is a stated uncertainty true, and is no `pass` false?

For each class: verdicts, and how far the six parameters and a point at the workpiece are off in units of their
stated 95 %.  Nothing is told but the diameter and what the class tells.
"""

from dataclasses import dataclass

import numpy as np
from harness import Row

from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult, ToolResult
from tests.trouble import Trouble, Troubled, all_troubles, troubled
from tests.trouble.cell import NAMES, Scanners

_CHI2_3_95 = 7.81
OTHERS: dict[Scanners, str] = {
    "fixed": ", a scanner that stands still",
    "two": ", two scanners",
    "both": ", a scanner on the flange and one that stands still",
}
SUMS = 4


@dataclass(frozen=True, eq=False)
class Outcome:
    """One session: verdict (`refused` where it was not solved), and errors over the stated 95 %, (7,)."""

    verdict: str
    errors: FloatArray
    warnings: list[str]

    @property
    def worst(self) -> float:
        return float(np.max(self.errors))


def outcome(trouble: Trouble, seed: int, told: bool = False, scanners: Scanners = "one") -> Outcome:
    cell = troubled(trouble, seed, told, scanners)
    try:
        result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
    except CalibrationError as error:
        return Outcome("refused", np.full(7, np.nan), [str(error)])
    assert isinstance(result, TcpResult)
    return Outcome(result.verdict, errors_over_stated(result, cell), result.warnings)


def errors_over_stated(result: ToolResult, cell: Troubled) -> FloatArray:
    """Return the errors of rx … tz, and of a point at the workpiece, over half the width of their 95 % (7,).

    Of two scanners, those of the second are among them (13,).
    """
    found = result.mount_from_laser
    truth = RigidTransform.from_rounded(cell.tool0_from_laser, found.into, "laser")
    six = _six(found, cell.tool0_from_laser @ cell.laser_from_files, result.covariance)
    assert result.workpiece is not None
    point = np.array(result.workpiece.point_in_laser_mm)
    seen = cell.scanner(point[None, [0, 2]])[0]
    # In base as the arm tells it: longer or shorter than it is; a pose in base is told so already.
    long = 1.0 if found.into == "base" else 1 + cell.too_long
    off = found.apply(np.array([seen[0], 0.0, seen[1]])) - long * truth.apply(point)
    squared = float(off @ np.linalg.solve(np.array(result.workpiece.covariance), off))
    of_first = np.append(six, np.sqrt(squared / _CHI2_3_95))
    if cell.other is None:
        return of_first
    second = next(one for one in result.frames if one.scanner == NAMES[1] and one.outof == "laser")
    other = RigidTransform.from_rounded(second.matrix, second.into, "laser")
    return np.append(_six(other, cell.other @ cell.laser_from_files, second.covariance), of_first)


def _six(found: RigidTransform, truth: FloatArray, covariance: object) -> FloatArray:
    """Return the errors of rx … tz over half the width of their stated 95 %, (6,)."""
    off = RigidTransform.from_rounded(truth, found.into, "laser").difference(found)
    return np.abs(off) / (1.96 * np.sqrt(np.diag(np.array(covariance, dtype=float))))


def run(full: bool) -> list[Row]:
    """Return a row a class and the sums; `full` takes 40 seeds, 20 with sigmas told; otherwise 3 and 1.

    Of other cells, which have two seeds or one, the sums alone.
    """
    plain = rows_of(all_troubles(), range(40 if full else 3))
    told = rows_of(all_troubles(), range(20 if full else 1), told=True)
    others = [row for one in OTHERS for row in rows_of(all_troubles(), range(1 + full), scanners=one)[-SUMS:]]
    return [*plain, *told, *others]


def rows_of(
    troubles: dict[str, Trouble], seeds: range, told: bool = False, scanners: Scanners = "one"
) -> list[Row]:
    rows: list[Row] = []
    shown: list[Outcome] = []
    clean: list[Outcome] = []
    what = ("sigmas told" if told else "nothing told") + OTHERS.get(scanners, "")
    for name, trouble in troubles.items():
        outcomes = [outcome(trouble, seed, told, scanners) for seed in seeds]
        shown += [] if trouble.is_hidden(scanners) else outcomes
        clean += outcomes if trouble.clean else []
        kind = "must pass" if trouble.clean else ("cannot be seen" if trouble.hidden else "")
        rows.append(Row(f"{name}, {what}", kind, counts_of(outcomes)))
    return [*rows, *sums(shown, clean, what)]


def sums(shown: list[Outcome], clean: list[Outcome], what: str) -> list[Row]:
    """Return the rows with a target: of the classes that captures can show, and of the clean ones among them."""
    passed = [o for o in shown if o.verdict == "pass"]
    three, two = (sum(o.worst > times for o in passed) for times in (3, 2))
    share = np.mean([o.verdict == "pass" for o in clean]) if clean else 1.0
    inside = np.concatenate([o.errors for o in passed]) <= 1
    return [
        Row(f"pass, and more than 3 × the stated 95 % off, {what}", "0", f"{three} of {len(passed)}", three == 0),
        Row(f"pass, and more than 2 × off, {what}", "≤ 1 %", f"{two} of {len(passed)}", two <= 0.01 * len(passed)),
        Row(f"clean classes that pass, {what}", "≥ 95 %", f"{share:.1%} of {len(clean)}", bool(share >= 0.95)),
        Row(
            f"stated 95 % that hold, under pass, {what}",
            "≥ 93 %",
            f"{inside.mean():.1%}",
            bool(inside.mean() >= 0.93),
        ),
    ]


def counts_of(outcomes: list[Outcome]) -> str:
    """Return verdicts (pass/warn/fail/refused), typical and largest error, and the largest of the last number."""
    counts = [sum(o.verdict == v for o in outcomes) for v in ("pass", "warn", "fail", "refused")]
    solved = [o for o in outcomes if o.verdict != "refused"]
    worst = max((o.worst for o in solved), default=float("nan"))
    typical = float(np.median([o.worst for o in solved])) if solved else float("nan")
    last = max((o.errors[-1] for o in solved), default=float("nan"))
    return "/".join(map(str, counts)) + f"  {typical:.2f} {worst:.2f} {last:.2f}"
