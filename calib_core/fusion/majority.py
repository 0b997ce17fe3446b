"""Which scan a merged point comes from, as far as it comes from one: that of the largest weight around it."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.fusion.overlap import Patches

NO_SCAN = -1
_AROUND = [offset for offset in product((-1, 0, 1), repeat=3) if any(offset)]


class HeaviestScans:
    """The scan that weighs most in each patch of the overlap.

    Parameters
    ----------
    seen : Patches
        Where the scans stand in the end.
    """

    def __init__(self, seen: Patches) -> None:
        keys = _keys(np.floor(seen.points_mm / seen.size_mm).astype(np.int64))
        order = np.lexsort((seen.variances_mm2, keys))
        first = order[np.diff(keys[order], prepend=-1) != 0]
        self._keys = keys[first]
        self._scans: NDArray[np.int64] = seen.scans[first]
        self._points_mm: FloatArray = seen.points_mm[first]
        self._size_mm = seen.size_mm

    def of(self, points_mm: NDArray[np.floating]) -> NDArray[np.int64]:
        """Return the number (N,) of the scan that weighs most in the patch of each point (N, 3).

        Where none has enough points in that patch, the nearest one beside it counts; where there is none either,
        the number is `NO_SCAN`, which as an index is the last.
        """
        numbers = np.full(len(points_mm), NO_SCAN)
        if not len(self._keys):
            return numbers
        voxels = np.floor(points_mm.astype(float) / self._size_mm).astype(np.int64)
        at, found = self._find(voxels)
        numbers[found] = self._scans[at[found]]
        left = np.flatnonzero(~found)
        nearest_mm = np.full(len(left), np.inf)
        for offset in _AROUND:
            at, found = self._find(voxels[left] + offset)
            away_mm = np.linalg.norm(self._points_mm[at] - points_mm[left], axis=1)
            nearer = found & (away_mm < nearest_mm)
            nearest_mm[nearer], numbers[left[nearer]] = away_mm[nearer], self._scans[at[nearer]]
        return numbers

    def _find(self, voxels: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return where each voxel (N, 3) stands, and whether it does."""
        wanted = _keys(voxels)
        at = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return at, self._keys[at] == wanted


def _keys(voxels: NDArray[np.int64]) -> NDArray[np.int64]:
    from calib_core.kernels.fusion import pack_keys

    return pack_keys(voxels)
