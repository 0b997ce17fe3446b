"""Cells of other topologies: how far what is found is from the truth, in what is stated."""

import tempfile
from pathlib import Path

import hypothesis as hy
import numpy as np
from harness import Row

import calib_core as cc
from calib_core.simulation import TopologyScenario
from tests.topologies import topologies
from tests.topology_errors import distances
from tests.topology_use import put_to_use

_CHI2_95 = {2: 5.99, 6: 12.59}
_SCENARIOS = {
    "fixed-scanner-turntable": (200, 6),
    "two-scanners": (100, 6),
    "scanners-on-flange-and-base": (100, 6),
    "positioner": (100, 6),
    "rail": (100, 6),
    "slide": (100, 6),
    "two-tables": (40, 2),
}


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes as many cells as the figures ask for."""
    rows = [row for name, counts in _SCENARIOS.items() for row in _rows(name, counts[0 if full else 1])]
    return [*rows, _drawn(50 if full else 4)]


def _drawn(count: int) -> Row:
    """Return how many drawn topologies are solved within 3 × what is stated, or say what is undetermined."""
    told: list[str] = []

    @hy.settings(
        max_examples=count, deadline=None, database=None, suppress_health_check=[*hy.HealthCheck], print_blob=False
    )
    @hy.seed(1)
    @hy.given(topologies())
    def solve(scenario: TopologyScenario) -> None:
        told.append(put_to_use(scenario, len(told) + 1, Path(folder)))

    with tempfile.TemporaryDirectory(prefix="scancell-") as folder:
        solve()
    counted = ", ".join(f"{told.count(what)} {what}" for what in dict.fromkeys(told))
    wrong = sum(what.startswith("wrong") for what in told)
    return Row(
        "drawn topologies",
        "each within 3 × its ± or named; used all the same",
        f"{counted} of {len(told)}",
        wrong == 0,
    )


def _rows(scenario: str, cells: int) -> list[Row]:
    squares: dict[str, list[float]] = {}
    errors: dict[str, list[float]] = {}
    freedom, unsolved = dict[str, int](), 0
    for seed in range(1, cells + 1):
        simulated, truth = cc.simulate(scenario, seed)
        try:
            results = simulated.run()
        except cc.CalibrationError:
            unsolved += 1
            continue
        for name, squared, many, error in distances(results["chain" if "chain" in results else "tcp"], truth):
            squares.setdefault(name, []).append(squared)
            errors.setdefault(name, []).append(error)
            freedom[name] = many
    rows = [Row(f"{scenario}: cells that are not solved", "0", f"{unsolved} of {cells}", unsolved == 0)]
    for name, found in squares.items():
        held = float(np.mean(np.array(found) < _CHI2_95[freedom[name]]))
        unit = "mm" if freedom[name] == 6 else "°"
        told = (
            f"{np.mean(found):.2f} of {freedom[name]}; {100 * held:.0f} %; "
            f"{np.sqrt(np.mean(np.square(errors[name]))):.3f} {unit} RMS"
        )
        rows.append(Row(f"{scenario}: {name}, NEES and 95 % that hold", "≥ 93 %", told, held >= 0.93))
    return rows
