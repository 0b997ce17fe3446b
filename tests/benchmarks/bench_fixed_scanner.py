"""A scanner that stands still before a ball on the flange, beside one on the flange: stated and true errors."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from harness import Row, kept

import calib_core as cc
from calib_core.frames import RigidTransform

SCENARIOS = {
    "told": ("tcp", "fixed-scanner"),
    "not told": ("tcp-unknown-sigmas", "fixed-scanner-unknown-sigmas"),
}


Cell = tuple[float, float, bool, float]
"""Of one cell: NEES, share of parameters within their 95 %, whether it passes, stated ± / error."""


def one_cell(scenario: str, seed: int) -> Cell:
    """Return what a simulated cell gave."""
    session, truth = cc.simulate(scenario, seed)
    result = session.run()["tcp"]
    found = result.mount_from_laser
    true = RigidTransform.from_rounded(truth[f"{found.into}_from_laser"], found.into, "laser")
    error, covariance = true.difference(found), np.array(result.covariance)
    point = np.array(result.workpiece.point_in_laser_mm)
    error_mm = float(np.linalg.norm(found.apply(point) - true.apply(point)))
    stated_mm = float(np.sqrt(np.trace(np.array(result.workpiece.covariance))))
    return (
        float(error @ np.linalg.solve(covariance, error)),
        float(np.mean(np.abs(error) < 1.96 * np.sqrt(np.diag(covariance)))),
        result.verdict == "pass",
        stated_mm / max(error_mm, 1e-6),
    )


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 200 cells of the target."""
    rows: list[Row] = []
    for told, names in SCENARIOS.items():
        seeds = range(200 if full else 30)
        flange, base = (
            [kept(f"{name}-{seed}", partial(one_cell, name, seed)) for seed in seeds] for name in names
        )
        rows += rows_of(told, flange, base)
    return rows


def rows_of(told: str, flange: Sequence[Cell], base: Sequence[Cell]) -> list[Row]:
    """Return the rows of cells with the scanner on the flange, and of as many where it stands still."""
    count = len(base)
    (nees, _, passed, stated), (own_nees, within, own_passed, own_stated) = (
        (np.mean(a), np.mean(b), np.mean(c), np.median(d))
        for a, b, c, d in (zip(*flange, strict=True), zip(*base, strict=True))
    )
    slack = 0.1 + 2 * np.sqrt(12 / count) / nees * (count < 200)
    near = bool(abs(own_nees / nees - 1) <= slack)
    what = f"a scanner that stands still, {count} cells, sigmas {told}:"
    return [
        Row(f"{what} mean NEES", f"{nees:.2f} ± {100 * slack:.0f} %", f"{own_nees:.2f}", near),
        Row(f"{what} stated 95 % hold", "≥ 93 %", f"{100 * within:.1f} %", bool(within >= 0.93)),
        Row(
            f"{what} pass", f"{100 * passed:.0f} %", f"{100 * own_passed:.0f} %", bool(own_passed >= passed - 0.03)
        ),
        Row(f"{what} stated ± / error, median", f"{stated:.2f}", f"{own_stated:.2f}"),
    ]
