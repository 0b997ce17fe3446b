"""Taking a simulated capture again: the same pose commanded, the arm and the scanner err anew."""

from dataclasses import replace

import numpy as np

from calib_core.errors import ConflictError
from calib_core.records import Capture
from calib_core.simulation.motion import turn
from calib_core.simulation.profile_cell import (
    Shot,
    World,
    commanded_pose,
    draw_centers,
    shot_from,
    true_pose,
)
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.writing import shot_files, shot_record

_APART_RAD = 0.35  # a pose that verifies is turned by up to so much about each axis from one that calibrated


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
            "{capture!r}, which is none",
            "Delete it and capture: the simulated cell then takes it as it did.",
            capture=capture,
        )
    again = _again(world, shot, name, np.random.default_rng([seed, 20_265]))
    return Capture.model_validate(shot_record(again, world)), shot_files(again, world)


def to_verify(simulated: SimulatedSession, name: str, seed: int) -> tuple[Capture, dict[str, bytes]]:
    """Take a capture that verifies: of the sphere where it stands, from a pose of its own.

    Parameters and errors are those of `retake`.
    """
    world = simulated.world
    taken = [] if world is None else [shot for shot in world.shots if shot.table is None]
    if world is None or not taken:
        raise ConflictError(
            "a simulated cell whose scanner sees the sphere",
            "one that takes frames or scans alone",
            "Verify with captures of your own.",
        )
    rng = np.random.default_rng([seed, 20_267])
    near = taken[int(rng.integers(len(taken)))]
    rotation = near.commanded[:3, :3] @ turn(rng.uniform(-_APART_RAD, _APART_RAD, 3))
    commanded = commanded_pose(world, rotation, draw_centers(1, world.options, rng)[0])
    actual = true_pose(commanded, world.options, rng)
    shot = shot_from(world, name, near.kind, commanded, actual, world.sphere_center_in_base_mm, rng)
    return Capture.model_validate({**shot_record(shot, world), "step": "verify"}), shot_files(shot, world)


def _again(world: World, shot: Shot, name: str, rng: np.random.Generator) -> Shot:
    actual = true_pose(shot.commanded, world.options, rng)
    # Only the sphere on the table has places of its own; on the floor it stands where it always stood.
    center_in_base = shot.sphere_center_in_base_mm if shot.table else world.sphere_center_in_base_mm
    again = shot_from(world, name, shot.kind, shot.commanded, actual, center_in_base, rng)
    return replace(again, table=shot.table)
