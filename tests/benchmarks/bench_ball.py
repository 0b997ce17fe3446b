"""A ball on the table, 72 scans of it around, by a chain that was calibrated on the same simulated cell.

Every error is that of the cell in method.md: 0.02 mm of a point, 0.05 mm and 0.2 mrad of the robot at each scan,
0.05 mrad of the table's encoder, and the chain that 14 + 16 captures of the sphere leave.
"""

from dataclasses import dataclass, replace

import numpy as np
from harness import Row

from calib_core.frames import FloatArray
from calib_core.fusion.solve import MergeOptions, MergeSolution, solve_merge
from calib_core.simulation import SimulatedSession, simulate
from calib_core.sphere.cloud import fit_sphere
from calib_core.stages.merge.solve import plan_merge
from calib_core.stages.pipeline import stage_input
from tests.merged_sphere import sphere_covariance


@dataclass(frozen=True, eq=False)
class Ball:
    """The ball in one merged cloud: errors of diameter and centre, and what is stated of them."""

    diameter_error_mm: float
    diameter_sigma_mm: float
    center_error_mm: FloatArray
    center_covariance: FloatArray

    @property
    def nees(self) -> float:
        return float(self.center_error_mm @ np.linalg.solve(self.center_covariance, self.center_error_mm))


@dataclass(frozen=True, eq=False)
class Run:
    """One seed, before and after a fine registration."""

    before: Ball
    after: Ball
    overlap_mm2: float
    expected_overlap_mm2: float


def ball_of(solution: MergeSolution, truth: dict[str, object]) -> Ball:
    fit = fit_sphere(solution.grid.cloud().points_mm.astype(float))
    covariance = sphere_covariance(solution.patches, solution.errors, fit.center_mm)
    return Ball(
        diameter_error_mm=2 * fit.radius_mm - float(str(truth["ball_diameter_mm"])),
        diameter_sigma_mm=2 * float(np.sqrt(covariance[3, 3])),
        center_error_mm=fit.center_mm - np.asarray(truth["ball_center_in_turntable_mm"], dtype=float),
        center_covariance=covariance[:3, :3],
    )


def one(seed: int, simulated: SimulatedSession | None = None) -> Run:
    simulated = simulated or simulate("ball", seed)
    plan = plan_merge(stage_input(simulated.session, "merge", simulated.files.__getitem__))
    options = MergeOptions(voxel_mm=0.5, mesh="none")
    before = solve_merge(plan.scans, plan.errors, options)
    after = solve_merge(plan.scans, plan.errors, replace(options, registration=True))
    apart = before.overlap
    return Run(
        ball_of(before, simulated.truth),
        ball_of(after, simulated.truth),
        apart.rms_mm**2,
        apart.expected_rms_mm**2,
    )


def nees_row(what: str, values: list[float], freedom: int) -> Row:
    half = 1.96 * np.sqrt(2 * freedom / len(values))
    mean = float(np.mean(values))
    target = f"{freedom - half:.2f} to {freedom + half:.2f}"
    return Row(what, target, f"{mean:.2f}", abs(mean - freedom) <= half)


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes 40 seeds."""
    seeds = 40 if full else 10
    runs = [one(seed) for seed in range(seeds)]
    ratio = float(np.sqrt(sum(r.overlap_mm2 for r in runs) / sum(r.expected_overlap_mm2 for r in runs)))
    rows = [
        Row(
            f"overlap RMS before any registration / predicted, {seeds} seeds",
            "0.90 to 1.10",
            f"{ratio:.3f} ({np.sqrt(np.mean([r.overlap_mm2 for r in runs])):.4f} mm)",
            0.9 <= ratio <= 1.1,
        )
    ]
    for name, balls in (("no registration", [r.before for r in runs]), ("registered", [r.after for r in runs])):
        errors = [abs(ball.diameter_error_mm) for ball in balls]
        stated = float(np.sqrt(np.mean([ball.diameter_sigma_mm**2 for ball in balls])))
        figure = (
            f"worst {max(errors):.4f}, RMS {np.sqrt(np.mean(np.square(errors))):.4f} mm (stated {stated:.4f} mm)"
        )
        rows += [
            Row(f"diameter of the ball, {name}", "≤ 0.02 mm", figure, max(errors) <= 0.02),
            nees_row(f"its centre, {name}: mean NEES (3)", [ball.nees for ball in balls], 3),
        ]
    squares = [(r.before.diameter_error_mm / r.before.diameter_sigma_mm) ** 2 for r in runs]
    rows.append(nees_row("diameter, no registration: mean squared error / stated variance", squares, 1))
    return rows
