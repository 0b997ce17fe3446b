"""A simulated session: the record, its files and the truth."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.profile_cell import World
from calib_core.simulation.table_cell import TableTruth


@dataclass(frozen=True, eq=False)
class SimulatedSession:
    """A session as a user would have recorded it, and what is true of it.

    Parameters
    ----------
    session : Session
        The record, poses in the convention `abb`.
    files : dict
        The bytes of every file that the captures name.
    truth : dict
        JSON data: where the scanner is, `sphere_center_in_base_mm`, `sides`, `sigmas`, `spoiled`, `seed`,
        `scenario` and more.
    world : World or None
        The simulated cell itself, for bounds and benchmarks; none behind frames.
    table : TableTruth or None
        The simulated turntable, where there is one.
    more : callable or None
        Takes one more capture of a cell of any topology: (step, name, rng) to its record and files.
    """

    session: Session
    files: dict[str, bytes]
    truth: dict[str, Any]
    world: World | None
    table: TableTruth | None = None
    more: Callable[[str, str, np.random.Generator], tuple[dict[str, Any], dict[str, bytes]] | None] | None = None
