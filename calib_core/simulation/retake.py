"""Taking a simulated capture again: the same pose commanded, the arm and the scanner err anew."""

from dataclasses import replace

import numpy as np

from calib_core.errors import ConflictError
from calib_core.records import Capture
from calib_core.simulation.frame_cell import FRAME_SCENARIOS, one_more_frame
from calib_core.simulation.motion import turn
from calib_core.simulation.profile_cell import Shot, World, commanded_pose, draw_centers, shot_from, true_pose
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.writing import shot_files, shot_record

_APART_RAD = 0.35  # a pose of its own is turned by up to so much about each axis from one that is there


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
        need = "a simulated capture of the sphere by a scanner of profiles, clouds or centres"
        to_do = "Delete it and capture: the simulated cell then takes it as it did."
        raise ConflictError(need, "{capture!r}, which is none", to_do, capture=capture)
    again = _again(world, shot, name, np.random.default_rng([seed, 20_265]))
    return Capture.model_validate(shot_record(again, world)), shot_files(again, world)


def another(
    simulated: SimulatedSession, step: str, name: str, seed: int
) -> tuple[Capture, dict[str, bytes]] | None:
    """Take one more capture for a step: of the sphere from a pose of its own, or of a board elsewhere in the view.

    Parameters are those of `retake`; None is returned where the cell has nothing more for the step.
    """
    rng = np.random.default_rng([seed, 20_267])
    if simulated.truth["scenario"] in FRAME_SCENARIOS:
        return one_more_frame(simulated.truth["scenario"], simulated.truth["seed"], step, name, rng)
    if simulated.more is not None:
        found = simulated.more(step, name, rng)
        return None if found is None else (Capture.model_validate(found[0]), found[1])
    world = simulated.world
    taken = (
        []
        if world is None
        else [shot for shot in world.shots if (shot.table is not None) == (step == "turntable")]
    )
    if world is None or not taken or step not in ("tcp", "turntable", "verify"):
        return None
    near = taken[int(rng.integers(len(taken)))]
    if step == "turntable":
        shot = _again(world, near, name, rng)
    else:
        rotation = near.commanded[:3, :3] @ turn(rng.uniform(-_APART_RAD, _APART_RAD, 3))
        commanded = commanded_pose(world, rotation, draw_centers(1, world.options, rng)[0])
        actual = true_pose(commanded, world.options, rng)
        shot = shot_from(world, name, near.kind, commanded, actual, world.sphere_center_in_base_mm, rng)
    return Capture.model_validate({**shot_record(shot, world), "step": step}), shot_files(shot, world)


def _again(world: World, shot: Shot, name: str, rng: np.random.Generator) -> Shot:
    actual = true_pose(shot.commanded, world.options, rng)
    # Only the sphere on the table has places of its own; on the floor it stands where it always stood.
    center_in_base = shot.sphere_center_in_base_mm if shot.table else world.sphere_center_in_base_mm
    again = shot_from(world, name, shot.kind, shot.commanded, actual, center_in_base, rng)
    return replace(again, table=shot.table)
