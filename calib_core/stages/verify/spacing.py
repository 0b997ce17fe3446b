"""A ball bar: the distance of its two spheres as the cell measures it, beside the calibrated one."""

from collections.abc import Mapping, Sequence

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.findings.codes import verify as codes
from calib_core.frames import FloatArray
from calib_core.records import Capture
from calib_core.records.findings import Finding
from calib_core.stages.verify.decision import Estimate
from calib_core.stages.verify.held_out import HeldOut, held_out
from calib_core.stages.verify.tool import Tool

LEAST_CAPTURES = 2  # of each sphere: one alone shows nothing of its own scatter
_FREEDOM = 3


def by_sphere(
    observations: Observations, captures: Sequence[Capture], tool: Tool, sphere: SphereSize
) -> dict[tuple[str, str], list[SphereObservation]]:
    """Return the observations by their capture's `mount` and their scanner, those of most captures first.

    Without a mount, by which of several balls of the answer they show.
    """
    mounts = {capture.id: capture.mount or "" for capture in captures}
    found: dict[tuple[str, str], list[SphereObservation]] = {}
    for observation in observations:
        ball = mounts[observation.capture] or tool.ball_of(observation, sphere)
        found.setdefault((ball, observation.scanner), []).append(observation)
    return dict(sorted(found.items(), key=lambda one: -len(one[1])))


def seen_once(groups: Mapping[tuple[str, str], Observations]) -> list[Finding]:
    """Return which spheres, or scanners, have a single capture: it is not judged."""
    found = list[Finding]()
    for (mount, scanner), seen in groups.items():
        captures = list(dict.fromkeys(one.capture for one in seen))
        if len(captures) < LEAST_CAPTURES:
            only = "sphere" if mount or not scanner else "scanner"
            found.append(codes.SEEN_ONCE(captures, sphere=mount or scanner, only=only))
    return found


def spacing(
    spheres: Mapping[str, Observations],
    sphere: SphereSize,
    tool: Tool,
    calibrated_mm: float,
    calibrated_sigma_mm: float,
) -> Estimate | None:
    """Return the error of the spheres' distance, radius held, and its U; None of any number of spheres but two.

    Notes
    -----
    2634-style: SD = L_measured − L_calibrated.  The tool's own covariance is not in the uncertainty: what is
    verified is no evidence for itself.  Where a sphere's captures scatter more than their noise, its centre's
    variance grows.
    """
    if len(spheres) != 2 or any(len(seen) < LEAST_CAPTURES for seen in spheres.values()):
        return None
    one, other = (held_out(seen, seen[0].size(sphere), tool.exact) for seen in spheres.values())
    between = one.center_mm - other.center_mm
    length = float(np.linalg.norm(between))
    way = between / length
    variance = way @ (_grown(one) + _grown(other)) @ way + calibrated_sigma_mm**2
    return Estimate(length - calibrated_mm, 2 * float(np.sqrt(variance)))


def _grown(found: HeldOut) -> FloatArray:
    freedom = max(found.degrees_of_freedom, _FREEDOM)
    return found.covariance * max(1.0, found.chi_squared / freedom)
