"""Taking a capture of the simulated sphere from a pose of one's own: arm and scanner err as in the others."""

import numpy as np

from calib_core.errors import ConflictError
from calib_core.records import Capture
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.profile_cell import rounded_pose, shot_from, true_pose
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.writing import shot_files, shot_record


def take(
    simulated: SimulatedSession, base_from_tool0: FloatArray, name: str, seed: int
) -> tuple[Capture, dict[str, bytes]]:
    """Send the flange to a pose (4, 4) and capture the still sphere from there.

    Parameters
    ----------
    simulated : SimulatedSession
    base_from_tool0 : (4, 4)
    name : str
        The capture's id.
    seed : int
        Of the errors of arm and scanner.

    Raises
    ------
    ConflictError
        If the cell is one without a scanner of profiles, clouds or centres.
    """
    world = simulated.world
    if world is None:
        raise ConflictError(
            "a simulated cell that measures points", "one that takes frames", "Use a tcp scenario."
        )
    rng = np.random.default_rng([seed, 20_266])
    commanded = rounded_pose(np.asarray(base_from_tool0, dtype=float))
    actual = true_pose(commanded, world.options, rng)
    kind, center = world.options.kinds[0], world.sphere_center_in_base_mm
    shot = shot_from(world, name, kind, commanded, actual, center, rng)
    return Capture.model_validate(shot_record(shot, world)), shot_files(shot, world)
