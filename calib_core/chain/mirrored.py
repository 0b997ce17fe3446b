"""What a scanner that stands still cannot tell of axes before it: on which side of its plane of light they are.

Every place of a ball, mirrored at the plane of light, moves about the mirrored axis as the ball moves about the
true one, and gives the same profiles.  Where a fixed scanner alone sees an axis, both answers are as likely: the
stated covariance has room for the other one, unless the sense in which the axis counts tells them apart.
"""

from collections.abc import Sequence

import numpy as np

from calib_core.chain.model import ChainData, ChainState
from calib_core.chain.observations import SphereObservation
from calib_core.frames import FloatArray


def mirror_spread(
    observations: Sequence[SphereObservation], data: ChainData, state: ChainState, told_direction: int | None
) -> FloatArray:
    """Return what the mirrored answer adds to the covariance of the edges' unknowns, (P, P).

    Parameters
    ----------
    observations, data
        All captures, and the same as arrays.
    state : ChainState
        The answer.
    told_direction : {1, -1}, optional
        The sense in which the axis counts.
    """
    walk, at = data.walk, state.position
    layout, spread = walk.layout, np.zeros((data.unknowns, data.unknowns))
    riding: np.ndarray = np.any(layout.rides[walk.place], axis=1)
    sided = any(
        o.kind != "profile" or o.side is not None for o, on in zip(observations, riding, strict=True) if on
    )
    if not riding.any() or walk.over_robot[riding].any() or sided or len(set(walk.scanner[riding].tolist())) > 1:
        return spread
    scanner = int(walk.scanner[riding][0])
    normal, origin = at.mount_rotations[scanner][:, 1], at.mount_translations[scanner]
    step = np.zeros(data.unknowns)
    for a, (edge, axis) in enumerate(zip(layout.axes, at.axes, strict=True)):
        if edge.carries != "object":
            continue
        z = axis.rotation[:, 2]
        sense = -1.0 if edge.kind == "rotary" else 1.0  # a mirrored turn counts the other way
        other = sense * (z - 2 * normal * (normal @ z))
        if other @ z < 0:
            if told_direction is not None:
                return np.zeros_like(spread)
            other = -other
        point = axis.origin - 2 * normal * (normal @ (axis.origin - origin))
        columns = layout.axis(a).start
        step[columns : columns + 2] = (axis.rotation.T @ np.cross(z, other))[:2]
        if edge.kind == "rotary":
            across = point - axis.origin
            across = across - other * (other @ across)
            step[columns + 2 : columns + 4] = (axis.rotation.T @ across)[:2]
    step[data.held] = 0.0
    return 0.5 * np.outer(step, step)


def with_spread(covariance: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the covariance of the edges' unknowns, and of nuisances behind them, with a spread of the former."""
    found, size = covariance.copy(), len(spread)
    found[:size, :size] += spread
    return found
