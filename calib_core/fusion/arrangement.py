"""How well scans fit together in another arrangement: what makes pairs appear names the mistake.

Scans whose poses are wrong do not overlap, or lie in each other's line of sight.  Arranged rightly, pairs of
surfaces that face the same way appear by the hundred, and lie together.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray
from calib_core.fusion.overlap import Patches, PoseErrors

_CELLS_ACROSS = 40.0
"""Of the largest scan: voxels in which an arrangement that is nearly right makes pairs."""


@dataclass(frozen=True, eq=False)
class Fit:
    """How well scans fit together.

    Parameters
    ----------
    pairs : int
        Of patches of different scans that face the same way and lie together.
    score : float
        The same, those that lie apart counting less.
    by_scan : (S,)
        The pairs of each scan.
    """

    pairs: int
    score: float
    by_scan: FloatArray


def coarse(seen: Patches) -> Patches:
    """Return patches as large as suits the object, for comparing arrangements."""
    across = [float(np.ptp(seen.points_mm[mine], axis=0).max()) for mine in seen.rows_of_scans() if len(mine)]
    size = max(across, default=0.0) / _CELLS_ACROSS
    return seen.coarser(max(size, seen.size_mm))


def fit(seen: Patches, ways: FloatArray | None = None, within: float = 0.5) -> Fit:
    """Return how well scans fit together, `within` this of a patch, after a transform of each, (S, 4, 4)."""
    from calib_core.kernels.overlap import pair_sums

    count = len(seen.names)
    there = seen if ways is None else seen.transformed(ways).in_voxels()
    none, totals, cut = PoseErrors.none(count), np.zeros((count, 4)), within * seen.size_mm
    rows = (there.bounds, there.scans, there.points_mm, there.normals, there.variances_mm2)
    pairs, squares, *_ = pair_sums(*rows, cut, none.common, np.empty((0, 0)), none.own, totals).tolist()
    return Fit(int(pairs), pairs - squares / cut**2, totals[:, 0])
