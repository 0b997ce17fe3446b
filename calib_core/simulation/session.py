"""A simulated session: the record, its files and the truth."""

from dataclasses import dataclass
from typing import Any

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
    """

    session: Session
    files: dict[str, bytes]
    truth: dict[str, Any]
    world: World | None
    table: TableTruth | None = None
