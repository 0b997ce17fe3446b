"""What a TCP becomes where all its captures' points move a little: by an error of the camera, say."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib_core.arms.alike import visits
from calib_core.chain.arrays import chain_data
from calib_core.chain.effective import with_effective_points
from calib_core.chain.held import tool_difference
from calib_core.chain.likelihood import fit
from calib_core.chain.observations import SphereObservation
from calib_core.chain.scanner import OF_FILES
from calib_core.chain.tcp import TcpSolution
from calib_core.frames import FloatArray


def shift_by(solution: TcpSolution, moved: Sequence[SphereObservation]) -> FloatArray:
    """Return rx ry rz tx ty tz of the tool and x y z of the sphere's centre, by which moved points move them.

    Captures, sides, weights and sigmas stay those of the solution, and its answer is where the fit begins.

    Parameters
    ----------
    solution : TcpSolution
    moved : sequence of SphereObservation
        The solution's captures in their order, with their moved points.
    """
    held, options = solution.held, solution.options
    data = chain_data(
        with_effective_points(moved, solution.sphere), solution.sphere, solution.point_sigma_mm, options.priors
    )
    scale = visits(data.rotations, data.translations) / solution.weights
    data = replace(data, pose_scale=scale).silent(solution.used)
    if not held.applied:
        data = replace(data, nuisance_sigmas=np.where(OF_FILES, 0.0, data.nuisance_sigmas))
    state = fit(data, held.state, solution.sigmas).state
    return np.concatenate([tool_difference(held.state, state), state.center - held.state.center])
