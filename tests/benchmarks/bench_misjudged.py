"""What is judged wrongly: sharp cells with every kind of trouble, and how much wider than the error a ± is.

A sharp cell has an arm that repeats to 0.01 mm, and 60 captures where a kind of trouble does not count them.
"""

from functools import partial

import numpy as np
from bench_trouble import outcome
from harness import Row, all_kept

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import Trouble, all_troubles, troubled
from tests.trouble.cell import Plan

_CERTIFIED_MM = 0.002


def run(full: bool) -> list[Row]:
    """Return the rows; `full` takes ten seeds of every kind and 150 of clean cells, otherwise two and 24."""
    rows = [*sharp(range(10 if full else 2)), *narrow(range(18 if full else 4))]
    return [*rows, *(row for count in (14, 30, 100) for row in clean(count, range(150 if full else 24)))]


def sharp(seeds: range) -> list[Row]:
    """Return how often a sharp cell passes and is far off, the workpiece among what is judged."""
    shown = [kind for kind in all_troubles().values() if not kind.hidden]
    cells = [(kind, seed) for kind in shown for seed in seeds]
    ends = all_kept({
        f"sharp-{kind.name}-{seed}".replace("/", "-"): partial(_sharp, kind, seed) for kind, seed in cells
    })  # fmt: skip
    passed = [worst for verdict, worst in ends if verdict == "pass"]
    what = f"sharp cells, {len(shown)} kinds, {len(ends)} sessions: `pass` beyond"
    return [beyond(passed, what, 3, 0.0), beyond(passed, what, 2, 0.01)] if ends else []


def _sharp(kind: Trouble, seed: int) -> tuple[str, float]:
    found = outcome(sharpened(kind), seed)
    return found.verdict, found.worst


def beyond(passed: list[float], what: str, times: int, most: float) -> Row:
    """Return how many of those that passed are off by more than so many stated 95 %."""
    far = sum(worst > times for worst in passed)
    target = f"≤ {most:.0%}" if most else "0"
    return Row(f"{what} {times} ×", target, f"{far} of {len(passed)}", far <= most * len(passed))


def sharpened(kind: Trouble) -> Trouble:
    """Return a kind of trouble in a sharp cell; what it says of the arm and its captures holds."""

    def change(plan: Plan, rng: np.random.Generator) -> None:
        plan.shifts, plan.tilts = 10, 50
        plan.position_mm, plan.orientation_rad = 0.01, 2e-5
        kind.change(plan, rng)

    return Trouble(kind.name, change, kind.clean, kind.hidden)


def narrow(seeds: range) -> list[Row]:
    """Return how cells end whose arcs are narrow: balls of 150 and 80 mm seen over 31°."""
    ends = all_kept({f"narrow-{mm}-{seed}": partial(_narrow, mm, seed) for mm in (75, 40) for seed in seeds})
    solved = [worst for verdict, worst in ends if verdict in ("pass", "warn")]
    what = f"{len(ends)} cells, balls of 150 and 80 mm seen over 31°: solved; worst error / stated"
    told = f"{len(solved)}; {max(solved, default=0.0):.1f}"
    return [Row(what, "all; ≤ 2", told, len(solved) == len(ends) and max(solved) <= 2)] if ends else []


def _narrow(radius_mm: float, seed: int) -> tuple[str, float]:
    def change(plan: Plan, rng: np.random.Generator) -> None:
        plan.radius_mm, plan.arc_deg = float(radius_mm), 15.5

    found = outcome(Trouble("narrow", change), seed)
    return found.verdict, found.worst


def clean(count: int, seeds: range) -> list[Row]:
    """Return by how much wider the stated ± at the workpiece is than clean cells of a certified ball err."""
    found = all_kept({f"clean-{count}-{seed}": partial(at_workpiece, count, seed) for seed in seeds})
    if not found:
        return []
    errors, variances = np.array([off for off, _ in found]), np.array([stated for _, stated in found])
    ratio = float(np.sqrt(variances.mean() / np.mean(errors**2)))
    what = (
        f"{len(found)} clean cells of {count} captures, certified ball: stated ± / (RMS error × 1.96), workpiece"
    )
    told = f"{ratio:.2f} ({np.sqrt(np.mean(errors**2)):.3f} mm an axis)"
    return [Row(what, "≤ 1.3", told, ratio <= 1.3)]


def at_workpiece(count: int, seed: int) -> tuple[list[float], list[float]]:
    """Return by how much a clean cell errs at the workpiece (3,), mm, and its stated variances (3,)."""

    def change(plan: Plan, rng: np.random.Generator) -> None:
        plan.told_diameter_mm, plan.told_diameter_sigma_mm = 2 * plan.radius_mm, _CERTIFIED_MM
        plan.tilts = count - plan.shifts

    cell = troubled(Trouble("certified", change), seed)
    result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    assert result.workpiece is not None
    point = np.array(result.workpiece.point_in_laser_mm)
    off = np.array(result.tool0_from_laser) - cell.tool0_from_laser
    return (off[:3, :3] @ point + off[:3, 3]).tolist(), np.diag(np.array(result.workpiece.covariance)).tolist()
