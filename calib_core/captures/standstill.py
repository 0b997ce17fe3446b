"""Standstill of a capture: what its exposures at one commanded pose say, as a record and as findings."""

from collections.abc import Iterable, Sequence

import numpy as np

from calib_core.findings import Finding
from calib_core.findings.codes.quality import NOT_STILL
from calib_core.frames import RigidTransform
from calib_core.records import Still
from calib_core.sphere.arc import ArcFit
from calib_core.sphere.standstill import standstill

# A controller that stands still may tell poses that differ in their last digit.
_SAME_PLACE_MM = 0.002
_SAME_ORIENTATION_RAD = 2e-5


def still_of(arcs: Iterable[tuple[RigidTransform, ArcFit]]) -> Still | None:
    """Return how much the arc moved between exposures that follow each other at one commanded pose.

    Parameters
    ----------
    arcs : iterable of (base_from_tool0, ArcFit)
        The exposures in which the sphere was found, in their order.

    Returns
    -------
    Still or None
        None where no two exposures share a pose: then it cannot be told.
    """
    groups: list[list[ArcFit]] = []
    began: RigidTransform | None = None
    for pose, fit in arcs:
        if began is None or not _is_same(began, pose):
            began = pose
            groups.append([])
        groups[-1].append(fit)
    found = standstill(groups)
    if found is None:
        return None
    return Still(
        exposures=found.exposures,
        movement_mm=found.movement_mm,
        noise_mm=found.noise_mm,
        chance=found.chance,
        stands_still=found.stands_still,
    )


def standstill_findings(still: Still | None) -> list[Finding]:
    """Return that something moved between exposures, where it did."""
    if still is None or still.stands_still:
        return []
    return [NOT_STILL(exposures=still.exposures, movement_mm=still.movement_mm, noise_mm=still.noise_mm)]


def is_resting(poses: Sequence[RigidTransform], within_mm: float, within_rad: float) -> bool:
    """Return whether poses told one after the other are one pose, but for what is within these limits."""
    differences = np.abs([poses[0].difference(pose) for pose in poses])
    return bool(differences[:, :3].max() <= within_rad and differences[:, 3:].max() <= within_mm)


def _is_same(one: RigidTransform, other: RigidTransform) -> bool:
    return is_resting([one, other], _SAME_PLACE_MM, _SAME_ORIENTATION_RAD)
