"""Universal Robots: numbers that may be a pose or joints, in metres and radians."""

import math

from calib_core.messages import message

_FARTHEST_M = 10.0


def plausible(pose: tuple[float, ...]) -> tuple[float, ...]:
    """Return a pose; raises ValueError where its numbers look like millimetres or degrees."""
    if max(abs(v) for v in pose[:3]) > _FARTHEST_M:
        raise ValueError(
            message(
                "{most:g} m from the base: are these millimetres? UR writes metres", most=max(map(abs, pose[:3]))
            )
        )
    if math.hypot(*pose[3:]) > 2 * math.pi + 1e-6:
        raise ValueError(
            message("a rotation vector longer than a full turn: are these degrees? UR writes radians")
        )
    return pose


def degrees(joints_rad: tuple[float, ...]) -> tuple[float, ...]:
    """Return joints in degrees; raises ValueError where they look like degrees already."""
    if max(map(abs, joints_rad)) > 4 * math.pi + 1e-6:
        raise ValueError(message("joints beyond two turns: are these degrees? UR writes radians"))
    return tuple(math.degrees(v) for v in joints_rad)
