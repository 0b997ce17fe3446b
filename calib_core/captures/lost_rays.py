"""Stripe centres that were dropped as they have no ray: counted as a frame is read, said wherever it counts."""

from dataclasses import dataclass

from calib_core.chain.observations import Observations
from calib_core.findings import Finding
from calib_core.findings.codes.captures import LOST_RAYS
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """The points of one file, (N, 2) or (N, 3), and how many stripe centres of a raw frame had no ray."""

    points: FloatArray
    without_ray: int = 0


def lost_rays(dropped: int) -> list[Finding]:
    """Return what is to be said of centres that were dropped beyond the distortion's fold; nothing of none."""
    return [LOST_RAYS(count=dropped)] if dropped else []


def lost_rays_of(observations: Observations) -> list[Finding]:
    """Return the same of the captures that a result rests on."""
    return lost_rays(sum(o.without_ray for o in observations))
