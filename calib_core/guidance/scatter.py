"""How much robot and sphere scatter by what the captures show, before they are solved and after.

As a solve finds it (`chain.variance`), from the arcs that were measured instead of their points: a guide that
assumed an ordinary arm promised 0.28 mm where the result stated 1.3 mm.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from calib_core.arms.alike import visits
from calib_core.chain.arrays import chain_data
from calib_core.chain.chain_data import ChainData, Sigmas, ToolPrior
from calib_core.chain.held import hold_files
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereSize
from calib_core.chain.rejection import core_of, judge_from
from calib_core.chain.scanner import COUNT, ScannerPriors
from calib_core.chain.variance import GivenSigmas, mean_sigmas
from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.design import MOUNTED_MM, TURN_RAD

_LEAST: Final = 5  # captures: three measured values of each, beside nine unknowns
GROSS: Final = 6.0  # times the median of the misfits: what a solve will leave out


@dataclass(frozen=True, eq=False)
class QuickSolve:
    """What captures say of each other through one tool and one sphere.

    Attributes
    ----------
    sigmas : Sigmas
        The robot's scatter, averaged over what the captures leave open of it.
    apart : tuple of str
        Captures that the others contradict: a solve will leave them out.
    workpiece : (3, 3) or None
        The covariance of a point measured at the workpiece as a result will state it, mm²; None of too few.
    """

    sigmas: Sigmas
    apart: tuple[str, ...]
    workpiece: FloatArray | None = None


def solved_quickly(
    seen: Observations,
    sphere: SphereSize,
    mount_from_laser: RigidTransform,
    center_mm: FloatArray,
    given: GivenSigmas,
    usual: Sigmas,
    point_in_laser_mm: FloatArray,
) -> QuickSolve:
    """Return how captures agree, judged as a solve judges them, by their arcs instead of their points.

    Parameters
    ----------
    seen : sequence of SphereObservation
        What was measured of each arc.
    sphere : SphereSize
    mount_from_laser, center_mm : RigidTransform, (3,)
        Near the answer.
    given : GivenSigmas
        What is told.
    usual : Sigmas
        What to believe while captures are too few to tell. Its table's angle is kept.
    point_in_laser_mm : (3,)
        Where the scanner sees the workpiece.
    """
    data = chain_data(seen, sphere, None, ScannerPriors())
    repeated = visits(data.rotations, data.translations)
    data = replace(data, tool_prior=_tool_prior(data, mount_from_laser), pose_scale=repeated)
    start = mount_from_laser.rotation, mount_from_laser.translation_mm, center_mm
    state = ChainState.predicted(data, *start)
    off = _misfit(seen, state)
    agree = off <= GROSS * max(float(np.median(off)), usual.position_mm)
    apart = tuple(one.capture for one, fits in zip(seen, agree, strict=True) if not fits)
    if agree.sum() < _LEAST:
        return QuickSolve(usual, apart)
    try:
        # Grown from as few as a solve grows from: its scatter may have another likeliest answer from all of them.
        judged = judge_from(seen, data, state, agree & core_of(off), given)
    except CalibrationError:
        return QuickSolve(usual, apart)
    sigmas = replace(mean_sigmas(judged.data, judged.fit, given), axes=usual.axes)
    workpiece = hold_files(judged, apply=True).at_workpiece(point_in_laser_mm, data.half_width_mm)
    return QuickSolve(sigmas, apart, workpiece)


def _tool_prior(data: ChainData, mount_from_laser: RigidTransform) -> ToolPrior:
    """Return a guess of the tool as loose as one of nothing: motions may not determine all of it yet."""
    rough = np.array([TURN_RAD] * 3 + [MOUNTED_MM] * 3)
    information = np.diag(1 / np.concatenate([rough, data.nuisance_sigmas[data.active]]) ** 2)
    mount = mount_from_laser.rotation[None], mount_from_laser.translation_mm[None]
    return ToolPrior(*mount, np.zeros(COUNT), information)


def _misfit(seen: Observations, state: ChainState) -> FloatArray:
    """Return how far each measured sphere, or circle of it, lies from where a state expects it, mm, (K,)."""
    found: list[float] = []
    for one, expected in zip(seen, state.centers_in_laser, strict=True):
        off = one.center_in_laser_mm - expected
        if one.circle_radius_mm is not None:
            cut = np.sqrt(max(state.radius_mm**2 - expected[1] ** 2, 0.0))
            off = np.array([off[0], one.circle_radius_mm - cut, off[2]])
        found.append(float(np.linalg.norm(off)))
    return np.array(found)
