"""Taking a simulated capture again: the same pose commanded, the arm and the scanner err anew."""

from dataclasses import replace

import numpy as np

from calib_core.errors import ConflictError
from calib_core.records import Capture
from calib_core.simulation.profile_cell import Shot, World, shot_from, true_pose
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.writing import shot_files, shot_record


def retake(simulated: SimulatedSession, capture: str, name: str, seed: int) -> tuple[Capture, dict[str, bytes]]:
    """Take a capture of the sphere again; what had spoiled it is gone.

    Parameters
    ----------
    simulated : SimulatedSession
    capture : str
        The id of the capture whose pose is commanded again.
    name : str
        The new capture's id.
    seed : int
        Of the new errors of arm and scanner.

    Returns
    -------
    record : Capture
    files : dict
        The bytes of its files by their names.

    Raises
    ------
    ConflictError
        If the capture is none of the sphere by a scanner of profiles, clouds or centres.
    """
    world = simulated.world
    shot = None if world is None else next((shot for shot in world.shots if shot.name == capture), None)
    if world is None or shot is None:
        raise ConflictError(
            "a simulated capture of the sphere by a scanner of profiles, clouds or centres",
            f"{capture!r}, which is none",
            "Delete it and capture: the simulated cell then takes it as it did.",
        )
    again = _again(world, shot, name, np.random.default_rng([seed, 20_265]))
    return Capture.model_validate(shot_record(again, world)), shot_files(again, world)


def _again(world: World, shot: Shot, name: str, rng: np.random.Generator) -> Shot:
    actual = true_pose(shot.commanded, world.options, rng)
    # Only the sphere on the table has places of its own; on the floor it stands where it always stood.
    center_in_base = shot.sphere_center_in_base_mm if shot.table else world.sphere_center_in_base_mm
    again = shot_from(world, name, shot.kind, shot.commanded, actual, center_in_base, rng)
    return replace(again, table=shot.table)
