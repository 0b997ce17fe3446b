"""Why a capture was rejected: what was measured, and what is likely."""

import numpy as np

from calib_core.chain.observations import Observations
from calib_core.frames import FloatArray
from calib_core.messages import Value

_SAME_PLACE_MM = 0.01


def rejection_reasons(
    observations: Observations, used: np.ndarray, squared_distance: FloatArray, offset_mm: FloatArray
) -> dict[str, dict[str, Value]]:
    """Return what is to be said of each capture that is not used, by capture.

    Parameters
    ----------
    observations : K captures
    used : (K,) bool
    squared_distance : (K,)
        Mahalanobis distance² from what the others expect.
    offset_mm : (K, 3)
        The capture's own sphere centre minus the solved one, along the axes of what carries it.
    """
    positions = np.array([o.base_from_tool0.translation_mm for o in observations])
    found: dict[str, dict[str, Value]] = {}
    for k in np.flatnonzero(~used).tolist():
        one, offset = observations[k], offset_mm[k]
        in_base = offset if one.carriers.ball == "base" else one.base_from_tool0.rotation @ offset
        x, y, z = in_base.tolist()
        twin = _same_pose(positions, observations, k)
        found[observations[k].capture] = {
            "distance_mm": float(np.linalg.norm(offset)),
            "x_mm": x,
            "y_mm": y,
            "z_mm": z,
            "times": float(np.sqrt(squared_distance[k] / 3)),
            "likely": "moved" if twin is None else "twin",
            "twin": twin or "",
        }
    return found


def _same_pose(positions: FloatArray, observations: Observations, k: int) -> str | None:
    near = np.linalg.norm(positions - positions[k], axis=1) < _SAME_PLACE_MM
    near[k] = False
    twins = np.flatnonzero(near)
    return observations[int(twins[0])].capture if len(twins) else None
