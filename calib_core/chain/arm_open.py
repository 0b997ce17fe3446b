"""Captures with poses corrected by the arm's errors; what is left open of these is among the answer's unknowns.

Where an answer ends, its unknowns have moved the arm's errors on: these are taken into the model and the poses,
so that whoever uses the answer has the poses that belong to it.
"""

from dataclasses import replace

import numpy as np

from calib_core.arms.errors import corrected_pose
from calib_core.chain.arm_model import ArmInput, ArmModel, arm_columns
from calib_core.chain.chain_data import ChainData
from calib_core.chain.held import Held
from calib_core.chain.likelihood import linearised_at
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereObservation
from calib_core.chain.rejection import Judged
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, RigidTransform


def corrected(observations: Observations, model: ArmModel) -> list[SphereObservation]:
    """Return observations with poses corrected by a model; those whose joints are not known stay as they are."""
    every = [(one, one.arm_moves) for one in observations]
    own = [one if moves is None else replace(one, arm_moves=moves[:, model.kept]) for one, moves in every]
    return _moved(own, model.values)


def _moved(observations: Observations, values: FloatArray) -> list[SphereObservation]:
    found: list[SphereObservation] = []
    for one in observations:
        if one.arm_moves is not None:
            pose = one.base_from_tool0
            moved = corrected_pose(pose.rotation, pose.translation_mm, one.arm_moves, values)
            one = replace(one, base_from_tool0=RigidTransform.of(*moved, "base", "tool0"))
        found.append(one)
    return found


def with_open_arm(data: ChainData, state: ChainState, observations: Observations, model: ArmModel) -> ChainData:
    """Return the captures of corrected observations, with what is left open of the arm as unknowns they share."""
    none = np.zeros((6, len(model.terms)))
    moves = np.array([none if one.arm_moves is None else one.arm_moves for one in observations])
    scales = np.array([term.sigma for term in model.terms])
    columns = arm_columns(data, state, ArmInput(model.terms, moves), np.arange(data.count)) * scales
    return replace(data, arm_columns=columns, arm_means=-model.values / scales, arm_moves=moves * scales)


def with_poses_of(data: ChainData, observations: Observations) -> ChainData:
    """Return the same captures with the poses of some observations of them."""
    rotations = np.array([one.base_from_tool0.rotation for one in observations])
    translations = np.array([one.base_from_tool0.translation_mm for one in observations])
    walk = replace(data.walk, rotations=rotations, translations=translations)
    rotations, translations = walk.across_robot()
    return replace(data, walk=walk, rotations=rotations, translations=translations)


def settled(
    model: ArmModel, observations: Observations, judged: Judged, held: Held
) -> tuple[ArmModel, list[SphereObservation], Judged, Held]:
    """Return an answer whose unknowns leave nothing open of the arm: model and poses are those that belong to it.

    Parameters
    ----------
    model : ArmModel
        By which the observations' poses are corrected.
    observations : K captures
    judged, held
        The answer of captures `with_open_arm`.
    """
    assert held.state.shared is not None
    count, scales = len(model.terms), np.array([term.sigma for term in model.terms])
    further = held.state.shared[-count:]
    own = (
        judged.fit.arm.of_terms if judged.fit.arm is not None else covariance_of(held.at.hessian)[-count:, -count:]
    )
    covariance = own * judged.inflation * np.outer(scales, scales)
    model = replace(model, values=model.values + scales * further, covariance=covariance)
    observations = _moved(observations, scales * further)

    def there(data: ChainData) -> ChainData:
        return replace(with_poses_of(data, observations), arm_means=-model.values / scales)

    def at(state: ChainState, data: ChainData) -> ChainState:
        assert state.shared is not None
        shared = state.shared.copy()
        shared[-count:] -= further
        return replace(state, walk=data.walk, shared=shared)

    data = there(held.data)
    state, found = at(held.state, data), at(held.found, data)
    held = replace(held, data=data, state=state, found=found, at=linearised_at(data, state, held.sigmas))
    data = there(judged.data)
    minimum = replace(judged.fit.minimum, state=at(judged.fit.state, data))
    judged = replace(judged, data=data, fit=replace(judged.fit, minimum=minimum))
    return model, observations, judged, held
