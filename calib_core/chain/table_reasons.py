"""Why a capture of the table was rejected: another mounting's label, another angle, a moved sphere."""

from collections.abc import Sequence

import numpy as np

from calib_core.chain.observations import TableObservations
from calib_core.chain.spread import spread_over
from calib_core.chain.turntable import TurntableSolution
from calib_core.findings import Finding
from calib_core.findings.codes.turntable import REMOUNTED
from calib_core.frames import FloatArray
from calib_core.messages import Value

_SAME_PLACE_MM = 2.0
_FITS = 0.1  # of the residual: a capture that fits another label so much better belongs there


def table_reasons(observations: TableObservations, table: TurntableSolution) -> dict[str, dict[str, Value]]:
    """Return what is to be said of each capture that is not used, by capture."""
    residuals, frame = table.residuals, table.frame
    found: dict[str, dict[str, Value]] = {}
    for k in np.flatnonzero(~table.used).tolist():
        o, distance = observations[k], float(residuals.distance_mm[k])
        other = _other_mount(residuals.places_mm[k], frame.mounts_mm, table.mounts, o.mount, distance)
        found[o.sphere.capture] = {
            "distance_mm": distance,
            "axial_mm": float(residuals.axial_mm[k]),
            "radial_mm": float(residuals.radial_mm[k]),
            "around_deg": float(np.rad2deg(residuals.angle_rad[k])),
            "times": float(np.sqrt(table.squared_distance[k] / 3)),
            "likely": "angle" if other is None else "mount",
            "mount": other or "",
        }
    return found


def _other_mount(
    own_places: FloatArray, places: FloatArray, names: Sequence[str], own: str, distance_mm: float
) -> str | None:
    """Return the mounting that fits either side (2, 3) of a capture far better than its own, if there is one."""
    off = np.linalg.norm(places[:, None] - own_places[None], axis=2).min(axis=1)
    best = int(np.argmin(off))
    return names[best] if names[best] != own and off[best] < max(_FITS * distance_mm, 1.0) else None


def remounted(observations: TableObservations, table: TurntableSolution) -> Finding | None:
    """Return where three rejected captures or more agree on a place of their own on the table."""
    rejected = np.flatnonzero(~table.used)
    if len(rejected) < 3:
        return None
    places = table.residuals.places_mm[rejected]
    guesses = places[spread_over(len(places))].reshape(-1, 3)
    agree = np.linalg.norm(places[None] - guesses[:, None, None], axis=3).min(axis=2) < _SAME_PLACE_MM
    best = int(np.argmax(agree.sum(axis=1)))
    middle, near = guesses[best], agree[best]
    if near.sum() < 3:
        return None
    names = [observations[int(k)].sphere.capture for k in rejected[near]]
    x, y, z = middle.tolist()
    return REMOUNTED(list(dict.fromkeys(names)), x_mm=x, y_mm=y, z_mm=z)
