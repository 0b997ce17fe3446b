"""The memory of a voxel grid: bricks of 4×4×4 voxels, found by a hash table, as many as are touched."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

SingleArray = NDArray[np.float32]
KeyArray = NDArray[np.int64]
CountArray = NDArray[np.int32]

_SLOTS_A_BRICK = 2
_SLOT_BYTES = 12


class Voxels(NamedTuple):
    """Occupied voxels, taken out of a table.

    Parameters
    ----------
    keys : (N,) int64
        Packed indices.
    sums : (N, 4), with normals (N, 7), with intensities too (N, 8), float32
        Weighted offset from the voxel's corner in voxels, weight, weighted normal and intensity.
    counts : (N,) int32
        Points.
    """

    keys: KeyArray
    sums: SingleArray
    counts: CountArray


class BrickTable:
    """Sums of voxels in bricks.

    Parameters
    ----------
    attributes : int
        What is summed beside places: 0, 3 for a normal, 4 with an intensity.
    bricks : int
        How many there is room for; a power of two.
    """

    def __init__(self, attributes: int, bricks: int) -> None:
        from calib_core.kernels.fusion import BRICK_VOXELS, EMPTY

        self.attributes = attributes
        self.room = bricks
        self.used = 0
        self._heads: KeyArray = np.full(_SLOTS_A_BRICK * bricks, EMPTY, dtype=np.int64)
        self._numbers: CountArray = np.zeros(_SLOTS_A_BRICK * bricks, dtype=np.int32)
        self._sums: SingleArray = np.zeros((bricks, BRICK_VOXELS, 4), dtype=np.float32)
        self._counts: CountArray = np.zeros((bricks, BRICK_VOXELS), dtype=np.int32)
        self._normals: SingleArray = np.zeros(
            (bricks if attributes else 0, BRICK_VOXELS, max(attributes, 3)), dtype=np.float32
        )

    @staticmethod
    def brick_bytes(attributes: int) -> int:
        """Return the memory that a brick takes, its share of the hash table included."""
        from calib_core.kernels.fusion import BRICK_VOXELS

        return BRICK_VOXELS * (20 + 4 * attributes) + _SLOTS_A_BRICK * _SLOT_BYTES

    @property
    def bytes(self) -> int:
        """The memory that the table takes when full."""
        return self.room * self.brick_bytes(self.attributes)

    def add_points(
        self,
        points: SingleArray,
        poses: FloatArray,
        weights: SingleArray,
        normals: SingleArray,
        origin: FloatArray,
        size_mm: float,
        first: int,
    ) -> tuple[int, int, int]:
        """Sum points, see `kernels.fusion.add_points`; return where to go on, points summed, points outside."""
        from calib_core.kernels import fusion

        self.used, following, added, outside = fusion.add_points(
            points, poses, weights, normals, origin, size_mm, *self._arrays, self.used, first
        )
        return following, added, outside

    def voxels(self) -> Voxels:
        """Return the occupied voxels."""
        from calib_core.kernels.fusion import voxel_keys

        part = slice(self.used)
        counts = self._counts[part]
        many = int(np.count_nonzero(counts))
        keys, places = np.empty(many, np.int64), np.empty(many, np.int64)
        voxel_keys(self._bricks()[part], counts, keys, places)
        sums = self._sums[part].reshape(-1, 4)[places]
        if self.attributes:
            sums = np.concatenate([sums, self._normals[part].reshape(-1, self.attributes)[places]], axis=1)
        return Voxels(keys, sums, counts.reshape(-1)[places])

    def larger(self, bricks: int) -> "BrickTable":
        """Return a table with room for more bricks that holds the same."""
        from calib_core.kernels.fusion import enter_bricks

        table = BrickTable(self.attributes, bricks)
        table.used = self.used
        enter_bricks(self._bricks(), table._heads, table._numbers)
        for new, old in (
            (table._sums, self._sums),
            (table._counts, self._counts),
            (table._normals, self._normals),
        ):
            new[: min(self.used, len(old))] = old[: self.used]
        return table

    def clear(self) -> None:
        """Forget all that was summed."""
        from calib_core.kernels.fusion import EMPTY

        self._heads.fill(EMPTY)
        for sums in (self._sums, self._counts, self._normals):
            sums[: self.used] = 0
        self.used = 0

    @property
    def _arrays(self) -> tuple[KeyArray, CountArray, SingleArray, CountArray, SingleArray]:
        return self._heads, self._numbers, self._sums, self._counts, self._normals

    def _bricks(self) -> KeyArray:
        """Return the packed indices (used,) of the bricks by number."""
        from calib_core.kernels.fusion import EMPTY

        taken = np.flatnonzero(self._heads != EMPTY)
        bricks = np.empty(self.used, dtype=np.int64)
        bricks[self._numbers[taken]] = self._heads[taken]
        return bricks
