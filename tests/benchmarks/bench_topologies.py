"""Cells of other topologies: how far what is found is from the truth, in what is stated."""

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import hypothesis as hy
import numpy as np
from harness import Row, all_kept

import calib_core as cc
from calib_core.library.opened import in_memory
from calib_core.records import Session
from calib_core.simulation import TOPOLOGY_SCENARIOS, TopologyScenario
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.pipeline import solve_stage
from tests.plate_bound import plate_bound
from tests.topologies import topologies
from tests.topology_errors import distances
from tests.topology_use import put_to_use

_CHI2_95 = {2: 5.99, 3: 7.81, 6: 12.59}
_CELLS = {
    "fixed-scanner-turntable": (200, 6),
    "two-scanners": (100, 6),
    "two-scanners-that-err": (100, 6),
    "scanners-on-flange-and-base": (100, 6),
    "plate": (100, 6),
    "plate-distances": (100, 6),
    "positioner": (100, 6),
    "rail": (100, 6),
    "gantry-turntable": (100, 6),
    "slide": (100, 6),
    "two-tables": (40, 2),
}
"""How many cells of each scenario the figures ask for, and how many show that all is well."""

_HELD_OUT = {"positioner": ("axes_deg", "tilt"), "rail": ("axes_mm", "rail")}
"""The four captures of each ball that are farthest out on such an axis are predicted from the others."""

_FARTHEST = 4
_AS_BELIEVED = ("two-scanners-that-err",)
"""Scanners' errors are drawn from what is believed of scanners: what robots do cancels in relative poses."""

Cell = dict[str, Any]
"""What one simulated cell gave: squared distances, errors and counts by what they are of; JSON data."""


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes as many cells as the figures ask for."""
    rows: list[Row] = []
    for name, counts in _CELLS.items():
        seeds = range(1, counts[0 if full else 1] + 1)
        if cells := all_kept({f"{name}-{seed}": partial(one_cell, name, seed) for seed in seeds}):
            rows += rows_of(name, cells)
    scenarios = enumerate(drawn(50 if full else 4), start=1)
    used = all_kept({f"drawn-{n}": partial(_used, scenario, n) for n, scenario in scenarios})
    return [*rows, *([drawn_row(used)] if used else [])]


def drawn(count: int) -> list[TopologyScenario]:
    """Return cells of any topology."""
    found: list[TopologyScenario] = []

    @hy.settings(
        max_examples=count, deadline=None, database=None, suppress_health_check=[*hy.HealthCheck], print_blob=False
    )
    @hy.seed(1)
    @hy.given(topologies())
    def keep(scenario: TopologyScenario) -> None:
        found.append(scenario)

    keep()
    return found


def _used(cell: TopologyScenario, seed: int) -> str:
    with tempfile.TemporaryDirectory(prefix="scancell-") as folder:
        return put_to_use(cell, seed, Path(folder))


def drawn_row(told: Sequence[str]) -> Row:
    """Return how many drawn topologies are solved within 3 × what is stated, or say what is undetermined."""
    counted = ", ".join(f"{told.count(what)} {what}" for what in dict.fromkeys(told))
    wrong = sum(what.startswith("wrong") for what in told)
    return Row(
        "drawn topologies",
        "each within 3 × its ± or named; used all the same",
        f"{counted} of {len(told)}",
        wrong == 0,
    )


def one_cell(name: str, seed: int) -> Cell:
    """Return what a simulated cell gave."""
    simulated, truth = cc.simulate(name, seed)
    try:
        results = simulated.run()
    except cc.CalibrationError as error:
        return {"unsolved": str(error)}
    last = results["chain" if "chain" in results else "tcp"]
    cell: Cell = {"squared": {}, "freedom": {}, "error": {}, "verdict": last.verdict}
    cell["rejected"] = [row.capture for row in last.residuals if not row.used]
    if name == "gantry-turntable":
        cell["open"] = all(np.isnan(row[3]) for row in last.tool0_from_laser[:3])
        _keep(cell, [_rotation(last, truth)])
        last = last.model_copy(update={"frames": []})
    if name.startswith("plate"):
        cell |= _plate(name, seed, results["tcp"], truth)
    else:
        _keep(cell, distances(last, truth))
    if name == "two-scanners":
        cell["apart_mm"] = _apart_mm(simulated.record, simulated.read, truth)
    if name in _HELD_OUT:
        cell["chance"] = _held_out(name, seed)
    return cell


def rows_of(name: str, cells: Sequence[Cell]) -> list[Row]:
    """Return the rows of the cells of one scenario."""
    solved = [cell for cell in cells if "unsolved" not in cell]
    passed = sum(cell["verdict"] == "pass" for cell in solved)
    judged = f"{len(solved)} of {len(cells)}; pass {passed}"
    rows = [Row(f"{name}: cells that are solved", "all", judged, len(solved) == len(cells))]
    for what in dict.fromkeys(what for cell in solved for what in cell["squared"]):
        squared = np.array([value for cell in solved for value in cell["squared"].get(what, [])])
        error = np.array([value for cell in solved for value in cell["error"].get(what, [])])
        many = next(cell["freedom"][what] for cell in solved if what in cell["freedom"])
        held, unit = float(np.mean(squared < _CHI2_95[many])), "mm" if many == 6 else "°"
        told = f"{squared.mean():.2f} of {many}; {100 * held:.0f} %; {np.sqrt(np.mean(error**2)):.3f} {unit} RMS"
        holds, asked = held >= 0.93, "≥ 93 %"
        if name in _AS_BELIEVED and what.startswith("laser:"):  # nothing else errs less than is believed
            holds, asked = abs(float(squared.mean()) / many - 1) <= 0.15, f"{many} ± 15 %"
        rows.append(Row(f"{name}: {what}, NEES and 95 % that hold", asked, told, holds))
    if name.startswith("plate"):
        lost = sum(len(cell["rejected"]) for cell in solved)
        rows.append(Row(f"{name}: good captures rejected", "0", str(lost), lost == 0))
    if name == "plate":
        three, one = (np.array([cell[which] for cell in solved]) for which in ("errors_mm", "one_ball_mm"))
        found_and_least = (_rms_each(three) / _rms_each(one)).reshape(2, 2)
        for what, found, bound in zip(("scanner's place", "its point at the ball"), *found_and_least, strict=True):
            told = f"{found:.2f}; bound {bound:.2f}"
            rows.append(Row(f"{name}: error / that with one ball, {what}", "≤ 0.75", told, found <= 0.75))
    if name == "plate-distances":
        off = max(cell["scale_off"] for cell in solved)
        rows.append(Row(f"{name}: scale found, worst", "0.1 %", f"{100 * off:.3f} %", off <= 1e-3))
    if name == "two-scanners":
        both = [cell["error"]["laser:left_from_laser:right"][0] for cell in solved]
        ratio = _rms(both) / _rms([cell["apart_mm"] for cell in solved])
        rows.append(Row(f"{name}: relative pose's error / solved apart", "≤ 0.8", f"{ratio:.2f}", ratio <= 0.8))
    chances = [cell["chance"] for cell in solved if "chance" in cell]
    if chances:
        held = int(np.sum(np.array(chances) > 0.05))
        what = f"{name}: readings of an axis that are held out, within 95 %"
        rows.append(Row(what, "≥ 93 %", f"{held} of {len(chances)}", held >= 0.93 * len(chances)))
    if name == "gantry-turntable":
        given = sum(not cell["open"] for cell in solved)
        rows.append(Row(f"{name}: numbers given to what is undetermined", "0", str(given), given == 0))
    return rows


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _rms_each(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=0))


def _keep(cell: Cell, found: Iterable[tuple[str, float, int, float]]) -> None:
    for what, squared, many, error in found:
        cell["squared"].setdefault(what, []).append(squared)
        cell["error"].setdefault(what, []).append(error)
        cell["freedom"][what] = many


def _rotation(result: Any, truth: Cell) -> tuple[str, float, int, float]:
    """Return how far the scanner's rotation on the flange is off."""
    turn = np.array(truth["tool0_from_laser"])[:3, :3].T @ np.array(result.tool0_from_laser)[:3, :3]
    off = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    squared = float(off @ np.linalg.solve(np.array(result.covariance, dtype=float)[:3, :3], off))
    return "rotation on the flange", squared, 3, float(np.rad2deg(np.linalg.norm(off)))


def _plate(name: str, seed: int, result: Any, truth: Cell) -> Cell:
    """Return the tool's errors beside those of the same cell with one ball, and the least; the scale's error."""
    if name == "plate-distances":
        found = dict(zip(result.scanner.names, result.scanner.values, strict=True))
        return {"scale_off": abs(float(found["scale_x"]) - (1 / truth["scanner_scale"] - 1))}
    plate = TOPOLOGY_SCENARIOS[name]
    session, files, alone = simulate_topology(replace(plate, balls=plate.balls[:1]), name, seed)
    one = in_memory(session, files).run("tcp")["tcp"]
    return {"errors_mm": _errors_mm(result, truth, plate), "one_ball_mm": _errors_mm(one, alone, plate)}


def _errors_mm(result: Any, truth: Cell, scenario: TopologyScenario) -> list[float]:
    """Return the errors of a scanner's place and of its point at the workpiece, and the least of both."""
    points = np.column_stack([[0.0, 0.0, 0.0, 1.0], [*result.workpiece.point_in_laser_mm, 1.0]])
    off = (np.array(result.tool0_from_laser) - np.array(truth["tool0_from_laser"])) @ points
    found, least = np.linalg.norm(off, axis=0), plate_bound(truth, scenario.cell)
    return [*found.tolist(), *least]


def _apart_mm(session: Session, read: Any, truth: Cell) -> float:
    """Return the error of two scanners' relative pose where each is solved by itself."""
    lasers: dict[str, np.ndarray] = {}
    for scanner in session.cell.scanners or {}:
        own = [one for one in session.captures if one.scanner == scanner]
        result = solve_stage(session.model_copy(update={"captures": own}), "tcp", read)
        lasers[scanner] = np.array(result.to_json()["tool0_from_laser"])
    true = {one["scanner"]: np.array(one["matrix"]) for one in truth["frames"] if one["outof"] == "laser"}
    left, right = lasers
    relative, told = (np.linalg.inv(each[left]) @ each[right] for each in (lasers, true))
    return float(np.linalg.norm(relative[:3, 3] - told[:3, 3]))


def _held_out(name: str, seed: int) -> float:
    """Return the chance of what captures at an axis' far readings say, by a solve without them; balls are told.

    One that says nothing, as it ends in an error, has none: 0.
    """
    session, files, _ = simulate_topology(replace(TOPOLOGY_SCENARIOS[name], told="names", on_axes=24), name, seed)
    field, axis = _HELD_OUT[name]
    reading = {one.id: (getattr(one, field) or {}).get(axis, 0.0) for one in session.captures}
    out: set[str] = set()
    for mount in dict.fromkeys(one.mount for one in session.captures):
        moved = [one.id for one in session.captures if one.mount == mount and reading[one.id]]
        out |= {*sorted(moved, key=reading.__getitem__)[-_FARTHEST:]}
    captures = [one.model_copy(update={"step": "verify"}) if one.id in out else one for one in session.captures]
    told = session.model_copy(update={"captures": captures})
    try:
        result = solve_stage(told, "verify", files.__getitem__)
    except cc.CalibrationError:
        return 0.0
    return float(result.to_json()["chance"])
