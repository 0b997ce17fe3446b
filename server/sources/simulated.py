"""The simulated cell as a source of captures."""

import json
import re
import zlib
from collections.abc import Collection, Mapping
from functools import lru_cache
from itertools import count
from typing import TYPE_CHECKING, Any

from pydantic import Field

from calib_core.errors import ConflictError
from calib_core.messages import message
from calib_core.records import Capture, StepName
from server.sources.source import Occasion, Settings, Source, Taken

if TYPE_CHECKING:
    from calib_core.simulation import SimulatedSession

_ANOTHER = 10_007  # apart from the seeds of other captures


class SimulatedSettings(Settings):
    """Which capture is taken: the next, of `step` where some are left; or one of the cell's own `again`."""

    step: StepName | None = None
    again: str | None = Field(default=None, max_length=64, description="The `id` of a capture to be taken again.")


def take(occasion: Occasion) -> Taken:
    """Return the capture that a session's simulated cell takes.

    Raises
    ------
    ConflictError
        If the session's cell is a real one, or there is nothing left to take.
    """
    device, chosen = occasion.device, occasion.settings
    if not device:
        raise ConflictError("a session of the simulated cell", "one of a real cell", "Upload captures to it.")
    if chosen.again:
        return capture_again(device, occasion.taken, chosen.again)
    return next_capture(device, occasion.taken, chosen.step)


SOURCE = Source(
    "simulated",
    "Simulated cell",
    "Takes the next capture of the session's simulated cell, or one again.",
    SimulatedSettings,
    take,
)


def simulated_session(device: Mapping[str, Any]) -> "SimulatedSession":
    """Return everything that a simulated cell will deliver, by what its session keeps of it; one seed, one cell.

    Raises
    ------
    InputError
        If there is no such scenario, or the edges that are described form no tree.
    """
    told = device.get("cell")
    return _simulated(str(device["scenario"]), int(device["seed"]), told and json.dumps(told))


@lru_cache(maxsize=8)
def _simulated(scenario: str, seed: int, described: str | None) -> "SimulatedSession":
    from calib_core.simulation import simulate, simulate_described

    if described is None:
        return simulate(scenario, seed)
    from calib_core.cell.described import cell_of
    from calib_core.records.described import DescribedCell

    told = DescribedCell.model_validate_json(described)
    cell_of(told, pose_convention="matrix")
    return simulate_described(told, "described", seed)


def truth_of(device: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a session's simulated cell knows of itself, by what the session keeps of it."""
    return simulated_session(device).truth


def next_capture(
    device: Mapping[str, Any], taken: Collection[str], step: str | None = None
) -> tuple[Capture, dict[str, bytes]]:
    """Return the simulated cell's next capture, of `step` where one is named, and its files by name.

    Raises
    ------
    ConflictError
        If all of them were taken.
    """
    simulated = simulated_session(device)
    left = [capture for capture in simulated.session.captures if capture.id not in taken]
    for capture in left:
        if step in (None, capture.step):
            return capture, {name: simulated.files[name] for name in capture.files}
    if step is not None:
        from calib_core.simulation import another

        number, name = next((n, name) for n in count(1) if (name := f"{step}{n:02d}") not in taken)
        if found := another(simulated, step, name, device["seed"] + _ANOTHER * number):
            return found
    raise ConflictError(
        "a capture that the simulated cell has not delivered yet",
        message("all of its captures for the step {step} in this session", step=step)
        if step
        else "all of its captures in this session",
        "Solve now; or remove a capture to take it again.",
    )


def capture_again(
    device: Mapping[str, Any], taken: Collection[str], capture: str
) -> tuple[Capture, dict[str, bytes]]:
    """Return a capture that the simulated cell takes again under a name of its own, and its files by name.

    Raises
    ------
    ConflictError
        If this one cannot be taken again.
    """
    first = re.sub(r"-again\d*$", "", capture)
    names = (f"{first}-again{number if number > 1 else ''}" for number in count(1))
    number, name = next((n, name) for n, name in enumerate(names, start=1) if name not in taken)
    from calib_core.simulation import retake

    place = zlib.crc32(first.encode())
    return retake(simulated_session(device), first, name, device["seed"] + place + number)
