"""A planned set of ten captures followed as planned: what the result states over what the plan promised."""

from dataclasses import replace

import numpy as np
from cells import ESTIMATED, GIVEN
from harness import Row

from calib_core.captures.observe import observe_capture
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import SphereSize
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpOptions
from calib_core.frames import RigidTransform
from calib_core.guidance.candidates import Room
from calib_core.guidance.design import SIGMAS, Assumed, worst_sigma
from calib_core.guidance.field_of_view import Sight
from calib_core.guidance.planner import PlannedSet, Situation, planned_set
from calib_core.records.planning import Limits
from calib_core.simulation import SimulatedSession, simulate
from tests.planned import take

COUNT = 10
SPHERE = SphereSize(40.0)
SIGHT = Sight(
    near_mm=125, far_mm=240, near_half_width_mm=45, far_half_width_mm=45, pitch_mm=0.1, point_sigma_mm=0.02
)


def planned(simulated: SimulatedSession, sigmas: Sigmas) -> tuple[Situation, PlannedSet]:
    """Plan ten poses by a drawing's tool, a millimetre and a third of a degree beside the true one."""
    seed = simulated.truth["seed"]
    rng = np.random.default_rng([seed, 79])
    true = RigidTransform(np.array(simulated.truth["tool0_from_laser"]), "tool0", "laser")
    tool = true.perturbed(np.concatenate([rng.normal(0, 0.005, 3), rng.normal(0, 1.0, 3)]))
    center = np.array(simulated.truth["sphere_center_in_base_mm"])
    home = np.array(simulated.truth["base_from_tool0"]["p01"])[:3, :3]
    assumed = Assumed(SPHERE, tool, center, sigmas, SIGHT.middle_mm)
    situation = Situation([], assumed, Room(SIGHT, Limits(tilt_deg=30, turn_deg=30), home))
    return situation, planned_set(situation, COUNT, grid=300, sweeps=1)


def stated_mm(simulated: SimulatedSession, plan: PlannedSet, options: TcpOptions) -> float:
    """Take the planned captures, solve, and return the standard deviation at the plan's point."""
    observed, seed = [], simulated.truth["seed"]
    for k, pose in enumerate(plan.poses.poses):
        capture, files = take(simulated, pose.matrix, f"c{k:02d}", 1000 * seed + k)
        observed.append(observe_capture(simulated.session, capture, files.__getitem__))
    held = solve_tcp(observed, SPHERE, options).held
    return float(worst_sigma(held.at_workpiece(SIGHT.middle_mm, SIGHT.far_half_width_mm)))


def ratios(seeds: range) -> tuple[list[float], list[float]]:
    """Return stated over promised with sigmas told, and with sigmas estimated."""
    told, estimated = list[float](), list[float]()
    for seed in seeds:
        simulated = simulate("tcp", seed)
        given = replace(SIGMAS, position_mm=0.05, orientation_rad=2e-4)
        _, plan = planned(simulated, given)
        told.append(stated_mm(simulated, plan, GIVEN) / plan.after_mm[-1])
        _, plan = planned(simulated, SIGMAS)
        estimated.append(stated_mm(simulated, plan, ESTIMATED) / plan.after_mm[-1])
    return told, estimated


def rows(told: list[float], estimated: list[float]) -> list[Row]:
    """Return the figures of some cells."""
    good = sum(0.85 <= r <= 1.15 for r in told)
    need = int(np.ceil(0.9 * len(told)))
    text = f"{good} of {len(told)} (median {np.median(told):.3f}, {min(told):.2f} … {max(told):.2f})"
    median = float(np.median(estimated))
    between = f"{median:.3f} ({np.quantile(estimated, 0.1):.2f} … {np.quantile(estimated, 0.9):.2f})"
    return [
        Row("stated / promised, sigmas told: 0.85 … 1.15", f"≥ {need} of {len(told)}", text, good >= need),
        Row("stated / promised, sigmas estimated: median", "0.9 … 1.1", between, 0.9 <= median <= 1.1),
    ]


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 100 cells of the target."""
    return rows(*ratios(range(100 if full else 6)))
