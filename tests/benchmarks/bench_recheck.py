"""A recheck with three captures: a change of five sigmas of the difference, and false alarms."""

from dataclasses import replace

import numpy as np
from cells import GIVEN, SPHERE, Cell
from harness import Row

from calib_core.captures.observe import observe_capture
from calib_core.chain.observations import SphereObservation
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.frames import FloatArray
from calib_core.records import Capture, Session
from calib_core.simulation import SimulatedSession, retake
from calib_core.stages.recheck.compare import Change, compared
from calib_core.stages.recheck.guide import recheck_plan
from calib_core.stages.verify.held_out import Tool

_CHANGES = ("scanner moved on the flange", "scanner turned on the flange", "sphere or robot moved")
_POINT_MM = 190.0  # where a turned scanner moves a point


def run(full: bool) -> list[Row]:
    """Return the figures over 100 cells with several rechecks each in full, 8 cells otherwise."""
    return figures(range(100 if full else 8), 5 if full else 4)


def figures(seeds: range, rechecks: int) -> list[Row]:
    """Return how often changes are found, and alarms of cells that did not change."""
    alarms: list[bool] = []
    found: dict[str, list[bool]] = {name: [] for name in _CHANGES}
    spread: list[FloatArray] = []
    for seed in seeds:
        cell = Cell.of("tcp", seed)
        solution = cell.solve(GIVEN)
        repeated = _poses_to_repeat(cell.simulated.session, {o.capture for o in cell.observations})
        still = [rechecked(cell, solution, cell.simulated, repeated, 100 * seed + k) for k in range(rechecks)]
        alarms += [change.changed != "nothing" for change in still]
        spread += [np.linalg.solve(np.linalg.cholesky(c.covariance), c.shift_in_laser_mm) for c in still]
        step_mm = 5 * still[0].uncertainty_mm / 2
        for name, moved in changed(cell.simulated, step_mm, np.random.default_rng([seed, 51])).items():
            for k in range(rechecks):
                change = rechecked(cell, solution, moved, repeated, 100 * seed + 50 + k)
                found[name].append(change.changed != "nothing")
    false, scale = float(np.mean(alarms)), float(np.mean(np.square(spread)))
    rows = [
        Row(f"{len(found[n])} rechecks, {n} by 5 σ of the difference: found", "≥ 95 %", f"{np.mean(found[n]):.1%}",
            bool(np.mean(found[n]) >= 0.95))
        for n in _CHANGES
    ]  # fmt: skip
    return [
        *rows,
        Row(
            f"{len(alarms)} rechecks of cells that did not change: alarms", "≤ 2 %", f"{false:.1%}", false <= 0.02
        ),
        Row("squared change of these / its variance, mean", "0.6–1.2", f"{scale:.2f}", 0.6 <= scale <= 1.2),
    ]


def changed(simulated: SimulatedSession, step_mm: float, rng: np.random.Generator) -> dict[str, SimulatedSession]:
    """Return the cell after each change, by which a point of the workpiece moves by so much."""
    world = simulated.world
    assert world is not None
    direction = rng.normal(size=3)
    shift = step_mm * direction / np.linalg.norm(direction)
    axis = np.cross(rng.normal(size=3), world.tool0_from_laser[:3, 2])
    axis *= step_mm / _POINT_MM / np.linalg.norm(axis)
    turned = world.tool0_from_laser.copy()
    turned[:3, :3] = (np.eye(3) + _skew(axis)) @ turned[:3, :3]
    moved = world.tool0_from_laser.copy()
    moved[:3, 3] += shift
    worlds = (
        replace(world, tool0_from_laser=moved),
        replace(world, tool0_from_laser=turned),
        replace(world, sphere_center_in_base_mm=world.sphere_center_in_base_mm + shift),
    )
    return {name: replace(simulated, world=one) for name, one in zip(_CHANGES, worlds, strict=True)}


def rechecked(
    cell: Cell, solution: TcpSolution, now: SimulatedSession, repeated: list[Capture], seed: int
) -> Change:
    """Return what three captures of the cell as it is now say."""
    then = {o.capture: o for o in cell.observations}
    pairs: list[tuple[SphereObservation, SphereObservation]] = []
    for number, capture in enumerate(repeated):
        record, files = retake(now, capture.id, f"r{number}", seed + 1000 * number)
        pairs.append((then[capture.id], observe_capture(cell.simulated.session, record, files.__getitem__)))
    tool = Tool(
        solution.joint.mount_from_laser, np.zeros((6, 6)), GIVEN.position_sigma_mm, GIVEN.orientation_sigma_rad
    )
    return compared([p[0] for p in pairs], [p[1] for p in pairs], SPHERE.radius_mm, solution.joint.center_mm, tool)


def _skew(v: FloatArray) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _poses_to_repeat(session: Session, used: set[str]) -> list[Capture]:
    """Return the captures among `used` whose poses are worth repeating."""
    plan = recheck_plan(session, {"tcp": {"residuals": [{"capture": name, "used": True} for name in used]}})
    by_id = {capture.id: capture for capture in session.captures}
    return [by_id[row.capture] for row in plan.poses]
