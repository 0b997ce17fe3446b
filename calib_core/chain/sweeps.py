"""Sweeps: the profiles of one share a part of their pose's error, so that n of them do not say what n poses would.

The arm errs alike along a short sweep.  The captures' scores (their pulls at the unknowns) then scatter more from
sweep to sweep than errors that are each profile's own explain; how much more tells the shared part, as a multiple
of the pose errors' variances, by the method of moments.  What it adds to the answer's covariance is added.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.likelihood import OwnEquations, linearised_at, own_equations
from calib_core.chain.model import ChainData, ChainState, Sigmas, chain_data
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.tcp import TcpSolution
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray

_LEAST_SWEEPS = 3


@dataclass(frozen=True, eq=False)
class _Sweep:
    """Of one sweep: Hessian (P, P), gradient (P,), and how pose errors of one σ that all share pull, (P, 6)."""

    hessian: FloatArray
    gradient: FloatArray
    pull: FloatArray


def with_shared_pose_errors(
    solution: TcpSolution, observations: Sequence[SphereObservation], sphere: SphereSize
) -> TcpSolution:
    """Return the solution with the covariance that pose errors shared within sweeps add.

    Unchanged where there are fewer than three sweeps, or where nothing is shared.
    """
    used = [o for o, good in zip(observations, solution.used, strict=True) if good]
    data = chain_data(used, sphere, solution.point_sigma_mm)
    tool = solution.joint.tool0_from_laser
    state = ChainState.predicted(data, tool.rotation, tool.translation_mm, solution.joint.center_in_base_mm)
    at = linearised_at(data, state, solution.sigmas)
    own = own_equations(at)
    levers = _levers(data, state, solution.sigmas, at.centers_in_laser + at.offset)
    sweeps = _sweeps([o.capture for o in used], own, levers)
    if len(sweeps) < _LEAST_SWEEPS:
        return solution
    covariance = covariance_of(at.hessian)
    shared = sum((s.pull @ s.pull.T for s in sweeps), np.zeros_like(covariance))
    ratio = shared_ratio(sweeps, covariance, shared)
    added = ratio * covariance @ shared @ covariance
    size = len(solution.covariance)
    return replace(solution, covariance=solution.covariance + added[:size, :size])


def shared_ratio(sweeps: Sequence[_Sweep], covariance: FloatArray, shared: FloatArray) -> float:
    """Return the variance of the shared pose errors over that of each profile's own, from the sweeps' scores.

    At the optimum a sweep's score is its pull less what all pulls together have moved the answer by: with H its
    Hessian, C the covariance and V the pull's variance, E[g gᵀ] = V − H C V − V C H + H C (Σ V) C H, where V is
    H + ratio · pull pullᵀ.
    """
    found = expected = slope = 0.0
    for s in sweeps:
        found += float(s.gradient @ covariance @ s.gradient)
        by_own = covariance @ s.hessian
        expected += float(np.trace(by_own) - np.trace(by_own @ by_own))
        pull = covariance @ (s.pull @ s.pull.T)
        slope += float(np.trace(pull) - 2 * np.trace(by_own @ pull))
        slope += float(np.trace(by_own @ covariance @ shared @ by_own))
    return max(0.0, (found - expected) / slope) if slope > 0 else 0.0


def _sweeps(captures: Sequence[str], own: OwnEquations, levers: FloatArray) -> list[_Sweep]:
    names = [name for name in dict.fromkeys(captures) if captures.count(name) > 1]
    sweeps: list[_Sweep] = []
    for name in names:
        there = np.array([capture == name for capture in captures])
        weighted = np.swapaxes(own.rows[there], 1, 2) @ own.reduced[there][:, :, :3]
        pull = (weighted @ levers[there]).sum(axis=0)
        sweeps.append(_Sweep(own.hessians[there].sum(axis=0), own.gradients[there].sum(axis=0), pull))
    return sweeps


def _levers(data: ChainData, state: ChainState, sigmas: Sigmas, predicted: FloatArray) -> FloatArray:
    """Return how errors of one σ, of orientation (about the flange) and position, move the centre, (K, 3, 6)."""
    laser_from_tool0 = state.tool_rotation.T
    arms = predicted + state.tool_in_laser
    x, y, z = arms.T
    nothing = np.zeros_like(x)
    across = np.array([[nothing, -z, y], [z, nothing, -x], [-y, x, nothing]]).transpose(2, 0, 1)
    turning = across @ laser_from_tool0 * sigmas.orientation_rad
    shifting = laser_from_tool0 @ data.rotations.transpose(0, 2, 1) * sigmas.position_mm
    return np.concatenate([turning, shifting], axis=2)
