"""Why a capture was rejected, in a sentence that says what was measured and what to do."""

from collections.abc import Sequence

import numpy as np

from calib_core.chain.observations import SphereObservation
from calib_core.frames import FloatArray

_SAME_PLACE_MM = 0.01


def rejection_reasons(
    observations: Sequence[SphereObservation],
    used: np.ndarray,
    squared_distance: FloatArray,
    offset_in_base_mm: FloatArray,
) -> list[str | None]:
    """Return a sentence for each capture that is not used.

    Parameters
    ----------
    observations : K captures
    used : (K,) bool
    squared_distance : (K,)
        Mahalanobis distance² from what the others expect.
    offset_in_base_mm : (K, 3)
        The capture's own sphere centre minus the solved one, in base.
    """
    positions = np.array([o.base_from_tool0.translation_mm for o in observations])
    reasons: list[str | None] = []
    for k in range(len(observations)):
        if used[k]:
            reasons.append(None)
            continue
        distance = float(np.linalg.norm(offset_in_base_mm[k]))
        times = np.sqrt(squared_distance[k] / 3)
        x, y, z = offset_in_base_mm[k]
        seen = (
            f"the sphere appears {distance:.2f} mm (x {x:+.2f}, y {y:+.2f}, z {z:+.2f} in base) from where the "
            f"other captures see it, {times:.0f} times the expected scatter"
        )
        twin = _same_pose(positions, observations, k)
        if twin is not None:
            reasons.append(
                f"{seen}; its pose is that of {twin}. Enter the pose of this capture, or take it again."
            )
        else:
            reasons.append(
                f"{seen}: the sphere was moved, or the pose is not this capture's. Check both and take it again."
            )
    return reasons


def _same_pose(positions: FloatArray, observations: Sequence[SphereObservation], k: int) -> str | None:
    near = np.linalg.norm(positions - positions[k], axis=1) < _SAME_PLACE_MM
    near[k] = False
    twins = np.flatnonzero(near)
    return observations[int(twins[0])].capture if len(twins) else None
