"""Voxel fusion: every point's place, weighted by its uncertainty, averaged in the voxel that it falls into.

Points go from the scanner's frame into T and into their voxel's sums in one pass, so the points themselves are
never kept.  Memory is that of the occupied voxels; beyond a limit, sums go to a store by tiles of space and come
back tile by tile.  The mean of a voxel is Σ w p / Σ w with w = 1/σ²; its random standard deviation is (Σ w)^−½.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError
from calib_core.frames import FloatArray

SingleArray = NDArray[np.float32]

_FULLEST = 0.6  # of a hash table's slots; beyond, linear probing slows down
_FIRST_SLOTS = 1 << 16
_TILE_BITS = 8  # a tile is 256 voxels wide


class SpillStore(Protocol):
    """Where voxels' sums go that memory does not hold."""

    def append(self, tile: int, data: bytes) -> None:
        """Add bytes to a tile."""
        ...

    def read(self, tile: int) -> bytes:
        """Return all bytes that were added to a tile."""
        ...


@dataclass(frozen=True, eq=False)
class VoxelCloud:
    """One point a voxel, in no particular order.

    Parameters
    ----------
    points_mm : (N, 3) float32
        Weighted means of what fell into each voxel.
    sigma_mm : (N,) float32
        Random standard deviation of each, from the weights.
    counts : (N,) int32
        How many points each stands for.
    normals : (N, 3) float32 or (0, 3)
        Unit, toward the scanner; NaN where the summed normals cancel.
    keys : (N,) int64
        The voxels' packed indices.
    """

    points_mm: SingleArray
    sigma_mm: SingleArray
    counts: NDArray[np.int32]
    normals: SingleArray
    keys: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points_mm)


class VoxelGrid:
    """A voxel grid that scans are added to, one after the other.

    Parameters
    ----------
    size_mm : float
        The voxels' edge.
    origin_mm : (3,)
        Corner of voxel 0 0 0.
    normals : bool
        Whether normals are averaged too.
    store : SpillStore, optional
        Takes what goes beyond `most_bytes`.  Without one, memory grows with the occupied voxels.
    most_bytes : int
        The most that the table may take in memory; used with a store.

    Raises
    ------
    InputError
        If the voxel size is not a positive number.
    """

    def __init__(
        self,
        size_mm: float,
        origin_mm: ArrayLike = (0.0, 0.0, 0.0),
        normals: bool = False,
        store: SpillStore | None = None,
        most_bytes: int = 1_000_000_000,
    ) -> None:
        if not (np.isfinite(size_mm) and size_mm > 0):
            raise InputError("a positive voxel size in mm", f"{size_mm}", "Give for example 0.5.", "voxel_mm")
        self.size_mm = float(size_mm)
        self.origin_mm: FloatArray = np.array(origin_mm, dtype=float)
        self.points_added = 0
        self.spills = 0
        self.peak_bytes = 0
        self._columns = 7 if normals else 4
        self._store = store
        self._most_slots = 1 << max(10, int(np.log2(max(most_bytes // (1.5 * self._slot_bytes), 1))))
        self._tiles: set[int] = set()
        self._allocate(min(_FIRST_SLOTS, self._most_slots) if store else _FIRST_SLOTS)

    @property
    def _slot_bytes(self) -> int:
        return 32 if self._columns == 4 else 64

    @property
    def occupied(self) -> int:
        """The voxels that are held in memory."""
        return self._used

    def add(
        self,
        points_mm: SingleArray,
        into_from_outof: FloatArray | None = None,
        weights: SingleArray | float = 1.0,
        normals: SingleArray | None = None,
        where: str = "",
    ) -> None:
        """Add the points of one scan.

        Parameters
        ----------
        points_mm : (P, C, 3) float32
            Rows; NaN where nothing came back.
        into_from_outof : (P, 4, 4) or (1, 4, 4), optional
            From the points' frame into the grid's, one a row or one for all; the identity if left out.
        weights : (P, C) float32, or float
            1/σ² of each point, mm⁻²; a point with 0 is left out.
        normals : (P, C, 3) float32, optional
            In the points' frame.
        where : str
            The scan's name, for errors.

        Raises
        ------
        InputError
            If a point lies beyond the grid, a weight is not finite, or the arrays' sizes differ.
        """
        from calib_core.kernels.fusion import add_points

        w = np.atleast_2d(np.asarray(weights, dtype=np.float32))
        poses = np.eye(4)[None] if into_from_outof is None else np.asarray(into_from_outof, dtype=float)
        n = np.empty((0, 0, 3), np.float32) if normals is None else normals
        self._require_sizes(points_mm, poses, w, n, where)
        points = np.ascontiguousarray(points_mm, dtype=np.float32)
        poses = np.ascontiguousarray(poses[:, :3])
        row = beyond = 0
        while row < len(points):
            table = (self._keys, self._sums, self._counts)
            room = int(_FULLEST * len(self._keys))
            self._used, row, added, outside = add_points(
                points, poses, w, n, self.origin_mm, self.size_mm, *table, self._used, row, room
            )
            self.points_added += added
            beyond += outside
            if row < len(points):
                self._make_room(points.shape[1])
        if beyond:
            raise InputError(
                f"points within {self.size_mm * 2**20 / 1000:.0f} m of the grid's origin",
                f"{beyond} points farther away",
                "Check the scan's unit and pose, or take larger voxels.",
                where,
            )

    def absorb(self, other: "VoxelGrid") -> None:
        """Add all that another grid of the same voxels holds in memory, which is of no use afterwards.

        Raises
        ------
        InputError
            If its voxels are others, or it has given some to a store.
        """
        same = other.size_mm == self.size_mm and np.array_equal(other.origin_mm, self.origin_mm)
        if not same or other._columns != self._columns or other._tiles:
            raise InputError("a grid of the same voxels", "another", "Make both grids alike.", "voxel_mm")
        from calib_core.kernels.fusion import add_sums

        step = self._most_slots // 4 if self._store else len(other._keys)
        for start in range(0, len(other._keys), step):
            part = slice(start, start + step)
            keys, sums, counts = other._keys[part], other._sums[part], other._counts[part]
            self._make_room(int(np.count_nonzero(counts)))
            self._used += add_sums(keys, sums, counts, self._keys, self._sums, self._counts)
        self.points_added += other.points_added

    def clouds(self) -> Iterator[VoxelCloud]:
        """Give the fused points, a tile at a time where sums went to the store; the grid stays as it is."""
        if not self._tiles:
            taken = np.flatnonzero(self._counts)
            yield self._cloud(self._keys[taken], self._sums[taken], self._counts[taken])
            return
        self._spill()
        assert self._store is not None
        for tile in sorted(self._tiles):
            yield self._cloud(*self._merged(self._store.read(tile)))

    def cloud(self) -> VoxelCloud:
        """Return all fused points at once."""
        pieces = list(self.clouds())
        if len(pieces) == 1:
            return pieces[0]
        names = ("points_mm", "sigma_mm", "counts", "normals", "keys")
        return VoxelCloud(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in names))

    def _require_sizes(
        self, points: SingleArray, poses: FloatArray, weights: SingleArray, normals: SingleArray, where: str
    ) -> None:
        if points.ndim != 3 or points.shape[2] != 3:
            raise InputError("rows of points (P, C, 3)", f"shape {points.shape}", "Reshape the scan.", where)
        fits = poses.shape in ((len(points), 4, 4), (1, 4, 4))
        fits &= weights.shape in (points.shape[:2], (1, 1))
        fits &= normals.shape == points.shape if self._columns == 7 else True
        if not fits:
            raise InputError(
                f"poses, weights and normals for {points.shape[0]}×{points.shape[1]} points",
                f"shapes {poses.shape}, {weights.shape} and {normals.shape}: a scan of another size",
                "Give the arrays of one scan together.",
                where,
            )
        if not np.isfinite(weights).all():
            raise InputError("finite weights", "NaN or infinity", "Check the points' sigmas.", where)

    def _allocate(self, slots: int) -> None:
        from calib_core.kernels.fusion import EMPTY

        words = self._slot_bytes // 4
        table = np.zeros((slots, words), dtype=np.int32)
        self._keys: NDArray[np.int64] = table.view(np.int64)[:, 0]
        self._sums: SingleArray = table.view(np.float32)[:, 2 : 2 + self._columns]
        self._counts: NDArray[np.int32] = table[:, 2 + self._columns]
        self._keys.fill(EMPTY)
        self._used = 0
        self.peak_bytes = max(self.peak_bytes, slots * self._slot_bytes)

    def _make_room(self, needed: int) -> None:
        slots = len(self._keys)
        if self._used + needed <= _FULLEST * slots:
            return
        while self._used + needed > _FULLEST * slots:
            slots *= 2
        if self._store is not None and slots > self._most_slots:
            if needed > _FULLEST * self._most_slots:
                raise InputError(
                    f"memory for at least {needed} voxels",
                    f"a limit of {self._most_slots} slots",
                    "Raise the limit.",
                    "most_bytes",
                )
            self._spill()
            return
        from calib_core.kernels.fusion import add_sums

        old = (self._keys, self._sums, self._counts)
        self._allocate(slots)
        self.peak_bytes = max(self.peak_bytes, (slots + len(old[0])) * self._slot_bytes)
        self._used = add_sums(*old, self._keys, self._sums, self._counts)

    def _record(self) -> np.dtype[np.void]:
        return np.dtype([("key", "<i8"), ("sums", "<f4", (self._columns,)), ("count", "<i4")])

    def _spill(self) -> None:
        """Give all sums to the store, by tiles, and begin anew with an empty table."""
        from calib_core.kernels.fusion import unpack_keys

        assert self._store is not None
        taken = np.flatnonzero(self._counts)
        if not len(taken):
            return
        tiles = _tile_numbers(unpack_keys(self._keys[taken]))
        order = np.argsort(tiles, kind="stable")
        taken, tiles = taken[order], tiles[order]
        bounds = np.concatenate([[0], np.flatnonzero(np.diff(tiles)) + 1, [len(tiles)]])
        for start, end in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
            rows = taken[start:end]
            records = np.empty(len(rows), dtype=self._record())
            records["key"], records["sums"], records["count"] = (
                self._keys[rows],
                self._sums[rows],
                self._counts[rows],
            )
            tile = int(tiles[start])
            self._store.append(tile, records.tobytes())
            self._tiles.add(tile)
        self.spills += 1
        self._allocate(len(self._keys))

    def _merged(self, data: bytes) -> tuple[NDArray[np.int64], SingleArray, NDArray[np.int32]]:
        from calib_core.kernels.fusion import EMPTY, add_sums

        records = np.frombuffer(data, dtype=self._record())
        slots = 1 << max(4, int(np.ceil(np.log2(len(records) / _FULLEST))))
        keys = np.full(slots, EMPTY, dtype=np.int64)
        sums = np.zeros((slots, self._columns), dtype=np.float32)
        counts = np.zeros(slots, dtype=np.int32)
        add_sums(records["key"], records["sums"], records["count"], keys, sums, counts)
        taken = np.flatnonzero(counts)
        return keys[taken], sums[taken], counts[taken]

    def _cloud(self, keys: NDArray[np.int64], sums: SingleArray, counts: NDArray[np.int32]) -> VoxelCloud:
        from calib_core.kernels.fusion import unpack_keys

        weight = sums[:, 3:4].astype(np.float64)
        points = (unpack_keys(keys) + sums[:, :3] / weight) * self.size_mm + self.origin_mm
        normals = np.empty((0, 3), np.float32)
        if self._columns == 7:
            lengths = np.linalg.norm(sums[:, 4:], axis=1, keepdims=True)
            normals = sums[:, 4:] / np.where(lengths > 0, lengths, np.nan).astype(np.float32)
        sigma = (1 / np.sqrt(weight[:, 0])).astype(np.float32)
        return VoxelCloud(points.astype(np.float32), sigma, counts, normals, keys)


def _tile_numbers(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return one number a tile of 256³ voxels, from voxel indices (N, 3)."""
    from calib_core.kernels.fusion import pack_keys

    return pack_keys(indices >> _TILE_BITS)


def fuse(
    scans: Sequence[tuple[SingleArray, FloatArray]],
    size_mm: float,
    origin_mm: ArrayLike = (0.0, 0.0, 0.0),
    workers: int = 2,
) -> VoxelGrid:
    """Return the grid of scans that need no cleaning, all points of equal weight, summed by several threads.

    Parameters
    ----------
    scans : sequence of ((P, C, 3) float32, (P, 4, 4) or (1, 4, 4))
        Points and their poses.
    size_mm, origin_mm
        As in `VoxelGrid`.
    workers : int
        Threads; each has a table of its own.

    Raises
    ------
    InputError
        As `VoxelGrid` does.
    """
    from concurrent.futures import ThreadPoolExecutor

    def part(first: int) -> VoxelGrid:
        grid = VoxelGrid(size_mm, origin_mm)
        for points, poses in scans[first::workers]:
            grid.add(points, poses)
        return grid

    with ThreadPoolExecutor(workers) as pool:
        first, *others = pool.map(part, range(workers))
    for other in others:
        first.absorb(other)
    return first
