"""A scanner that stands still before a ball on the flange, beside one on the flange: stated and true errors."""

from dataclasses import dataclass

import numpy as np
from harness import Row

import calib_core as cc
from calib_core.frames import RigidTransform

SCENARIOS = {
    "told": ("tcp", "fixed-scanner"),
    "not told": ("tcp-unknown-sigmas", "fixed-scanner-unknown-sigmas"),
}


@dataclass(frozen=True)
class Cells:
    """Over many cells: mean NEES, share of parameters within their 95 %, how many pass, stated ± / error."""

    nees: float
    within: float
    passed: float
    stated: float


def cells(scenario: str, count: int) -> Cells:
    """Return what many cells of a scenario gave."""
    nees: list[float] = []
    within: list[float] = []
    passed: list[bool] = []
    stated: list[float] = []
    for seed in range(count):
        session, truth = cc.simulate(scenario, seed)
        result = session.run()["tcp"]
        found = result.mount_from_laser
        true = RigidTransform.from_rounded(truth[f"{found.into}_from_laser"], found.into, "laser")
        error, covariance = true.difference(found), np.array(result.covariance)
        nees.append(float(error @ np.linalg.solve(covariance, error)))
        within.append(float(np.mean(np.abs(error) < 1.96 * np.sqrt(np.diag(covariance)))))
        passed.append(result.verdict == "pass")
        point = np.array(result.workpiece.point_in_laser_mm)
        error_mm = float(np.linalg.norm(found.apply(point) - true.apply(point)))
        stated.append(float(np.sqrt(np.trace(np.array(result.workpiece.covariance)))) / max(error_mm, 1e-6))
    return Cells(float(np.mean(nees)), float(np.mean(within)), float(np.mean(passed)), float(np.median(stated)))


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 200 cells of the target."""
    count = 200 if full else 30
    rows: list[Row] = []
    for told, (on_flange, fixed) in SCENARIOS.items():
        flange, base = cells(on_flange, count), cells(fixed, count)
        slack = 0.1 if full else 0.1 + 2 * np.sqrt(12 / count) / flange.nees
        rows += [
            Row(
                f"mean NEES, {count} cells, sigmas {told}",
                f"{flange.nees:.2f} ± {100 * slack:.0f} %",
                f"{base.nees:.2f}",
                abs(base.nees / flange.nees - 1) <= slack,
            ),
            Row("stated 95 % hold", "≥ 93 %", f"{100 * base.within:.1f} %", base.within >= 0.93),
            Row(
                "pass",
                f"{100 * flange.passed:.0f} %",
                f"{100 * base.passed:.0f} %",
                base.passed >= flange.passed - 0.03,
            ),
            Row("stated ± at the workpiece / error, median", f"{flange.stated:.2f}", f"{base.stated:.2f}"),
        ]
    return rows
