"""Scanning cells with known truth: their own forward model, which shares no code with the solvers.

``simulate("tcp", seed=7)`` gives a session record, its files and the truth; `SCENARIOS` lists the names.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from calib_core.errors import InputError
from calib_core.records import Session
from calib_core.records.described import DescribedCell
from calib_core.simulation.described import scenario_of
from calib_core.simulation.frame_cell import FRAME_SCENARIOS, simulate_frames
from calib_core.simulation.part_cell import PART_SCENARIOS, simulate_part
from calib_core.simulation.profile_cell import Shot, World, build_world
from calib_core.simulation.retake import another, retake
from calib_core.simulation.scenarios import SCENARIOS, TcpScenario
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.sweep_cell import SWEEP_SCENARIOS, SweepScenario, simulate_sweeps
from calib_core.simulation.table_cell import TABLE_SCENARIOS, TableScenario, build_table_world
from calib_core.simulation.topology_more import one_more, simulate_with_scans
from calib_core.simulation.topology_scenarios import TOPOLOGY_SCENARIOS
from calib_core.simulation.topology_wanted import TopologyScenario
from calib_core.simulation.verify_cell import VERIFY_SCENARIOS, VerifyScenario, verify_options, with_verification
from calib_core.simulation.whole_cell import WHOLE_SCENARIOS, WholeScenario, with_scans
from calib_core.simulation.writing import session_files, session_record

__all__ = [
    "FRAME_SCENARIOS", "PART_SCENARIOS", "SCENARIOS", "SWEEP_SCENARIOS", "TABLE_SCENARIOS",
    "TOPOLOGY_SCENARIOS", "VERIFY_SCENARIOS", "WHOLE_SCENARIOS", "Shot", "SimulatedSession", "SweepScenario",
    "TableScenario", "TcpScenario", "TopologyScenario", "VerifyScenario", "WholeScenario", "World", "another",
    "retake", "simulate", "simulate_described", "simulate_table", "simulate_tcp", "simulate_verify"
]  # fmt: skip

_WITHOUT_WORLD: tuple[tuple[Mapping[str, Any], Callable[[Any, str, int], tuple[Session, Any, Any]]], ...] = (
    (SWEEP_SCENARIOS, simulate_sweeps),
    (PART_SCENARIOS, simulate_part),
    (FRAME_SCENARIOS, simulate_frames),
)
_ALL = (
    SCENARIOS,
    TOPOLOGY_SCENARIOS,
    TABLE_SCENARIOS,
    WHOLE_SCENARIOS,
    VERIFY_SCENARIOS,
    *(known for known, _ in _WITHOUT_WORLD),
)


def simulate(scenario: str, seed: int) -> SimulatedSession:
    """Return the session of a named scenario; the same seed always gives the same bytes.

    Raises
    ------
    InputError
        If no scenario has this name or the seed is negative.
    """
    require_scenario(scenario)
    _require_seed(seed)
    if scenario in TOPOLOGY_SCENARIOS:
        return _topology(TOPOLOGY_SCENARIOS[scenario], scenario, seed)
    for scenarios, made in _WITHOUT_WORLD:
        if scenario in scenarios:
            return SimulatedSession(*made(scenarios[scenario], scenario, seed), None)
    if scenario in TABLE_SCENARIOS:
        return simulate_table(seed, TABLE_SCENARIOS[scenario], scenario)
    if scenario in VERIFY_SCENARIOS:
        return simulate_verify(seed, VERIFY_SCENARIOS[scenario], scenario)
    if scenario in WHOLE_SCENARIOS:
        whole = WHOLE_SCENARIOS[scenario]
        return with_scans(simulate_table(seed, whole.table, scenario), whole, seed)
    return simulate_tcp(seed, SCENARIOS[scenario], scenario)


def require_scenario(scenario: str) -> None:
    """Raise InputError, which names all of them, if no scenario has this name."""
    names = [name for scenarios in _ALL for name in scenarios]
    if scenario not in names:
        raise InputError.unknown(scenario, names, "scenario")


def simulate_described(told: DescribedCell, name: str, seed: int) -> SimulatedSession:
    """Return the session of a cell that is described by its edges.

    Raises
    ------
    InputError
        If a scanner sees no ball that anything moves before it, or the seed is negative.
    """
    _require_seed(seed)
    return _topology(scenario_of(told), name, seed)


def _topology(options: TopologyScenario, name: str, seed: int) -> SimulatedSession:
    made = simulate_with_scans(options, name, seed)
    return SimulatedSession(*made, None, more=partial(one_more, options, seed))


def simulate_tcp(seed: int, options: TcpScenario, name: str = "tcp") -> SimulatedSession:
    """Return a TCP session of a simulated cell with explicit options.

    Raises
    ------
    InputError
        If the seed is negative.
    """
    _require_seed(seed)
    world = build_world(options, np.random.default_rng([seed, 20_260]))
    truth = {**world.truth(), "seed": seed, "scenario": name}
    return SimulatedSession(
        session_record(world, f"simulated {name}, seed {seed}"), session_files(world), truth, world
    )


def simulate_table(seed: int, options: TableScenario, name: str = "turntable") -> SimulatedSession:
    """Return a session of TCP and turntable captures of a simulated cell with explicit options.

    Raises
    ------
    InputError
        If the seed is negative.
    """
    _require_seed(seed)
    world, table = build_table_world(options, np.random.default_rng([seed, 20_261]))
    truth = {**world.truth(), **table.truth(), "seed": seed, "scenario": name}
    record = session_record(world, f"simulated {name}, seed {seed}")
    if options.tcp.sigmas == "given":
        sigma_deg = float(np.rad2deg(options.angle_sigma_rad))
        turntable = record.cell.turntable.model_copy(update={"angle_sigma_deg": sigma_deg})
        record = record.model_copy(update={"cell": record.cell.model_copy(update={"turntable": turntable})})
    return SimulatedSession(record, session_files(world), truth, world, table)


def simulate_verify(seed: int, options: VerifyScenario, name: str = "verify") -> SimulatedSession:
    """Return a session of TCP captures and of those that verify the answer, with explicit options.

    Raises
    ------
    InputError
        If the seed is negative.
    """
    return with_verification(simulate_tcp(seed, verify_options(options), name), options, seed)


def _require_seed(seed: int) -> None:
    if seed < 0:
        raise InputError("a seed of 0 or more", str(seed), "Give another seed.")
