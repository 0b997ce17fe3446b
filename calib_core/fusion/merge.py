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

from calib_core.errors import InputError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.bricks import BrickTable, Voxels

SingleArray = NDArray[np.float32]

_FIRST_BRICKS = 1 << 12
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
    coherence : (N,) float32 or (0,)
        Length of the mean of each voxel's normals: 1 on a plane, 0.7 across a sharp edge.
    intensity : (N,) float32 or (0,)
        Weighted mean; NaN where a point of the voxel had none.
    """

    points_mm: SingleArray
    sigma_mm: SingleArray
    counts: NDArray[np.int32]
    normals: SingleArray
    keys: NDArray[np.int64]
    coherence: SingleArray
    intensity: SingleArray

    def __len__(self) -> int:
        return len(self.points_mm)


def joined_clouds(pieces: Sequence[VoxelCloud]) -> VoxelCloud:
    """Return clouds of different voxels as one."""
    if len(pieces) == 1:
        return pieces[0]
    if not pieces:
        raise MeasurementError("points on a surface", "none", "Scan the object from nearer.", "scans")
    names = ("points_mm", "sigma_mm", "counts", "normals", "keys", "coherence", "intensity")
    return VoxelCloud(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in names))


class VoxelGrid:
    """A voxel grid that scans are added to, one after the other.

    Parameters
    ----------
    size_mm : float
        The voxels' edge.
    origin_mm : (3,)
        Corner of voxel 0 0 0.
    normals, intensity : bool
        Whether normals are averaged too, and intensities behind them.
    store : SpillStore, optional
        Takes what goes beyond `most_bytes`.  Without one, memory grows with the occupied voxels.
    most_bytes : int
        The most that the table may take in memory; used with a store.
    first_bricks : int
        How many bricks there is room for at first, a power of two.

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
        first_bricks: int = _FIRST_BRICKS,
        intensity: bool = False,
    ) -> None:
        if not (np.isfinite(size_mm) and size_mm > 0):
            raise InputError("a positive voxel size in mm", f"{size_mm}", "Give for example 0.5.", "voxel_mm")
        self.size_mm = float(size_mm)
        self.origin_mm: FloatArray = np.array(origin_mm, dtype=float)
        self.points_added = 0
        self.spills = 0
        self._store = store
        attributes = 4 if intensity else 3 if normals else 0
        self._most_bricks = 1 << max(0, int(np.log2(max(most_bytes // BrickTable.brick_bytes(attributes), 1))))
        self._tiles: set[int] = set()
        self._table = BrickTable(attributes, min(first_bricks, self._most_bricks) if store else first_bricks)
        self.peak_bytes = self._table.bytes

    @property
    def held_bytes(self) -> int:
        """What the table takes in memory now."""
        return self._table.bytes

    @property
    def is_empty(self) -> bool:
        """Whether no point was added."""
        return not self._tiles and self._table.used == 0

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
        normals : (P, C, 3) or with intensities (P, C, 4) float32, optional
            In the points' frame.
        where : str
            The scan's name, for errors.

        Raises
        ------
        InputError
            If a point lies beyond the grid, a weight is not finite, or the arrays' sizes differ.
        """
        w = np.atleast_2d(np.asarray(weights, dtype=np.float32))
        poses = np.eye(4)[None] if into_from_outof is None else np.asarray(into_from_outof, dtype=float)
        n = np.empty((0, 0, 3), np.float32) if normals is None else normals
        self._require_sizes(points_mm, poses, w, n, where)
        # Strided and read-only arrays would each have a kernel of their own compiled.
        points, w, n = (np.require(some, np.float32, ["C", "W"]) for some in (points_mm, w, n))
        poses = np.require(poses[:, :3], None, ["C", "W"])
        count = points.shape[0] * points.shape[1]
        following = beyond = 0
        while following < count:
            following, added, outside = self._table.add_points(
                points, poses, w, n, self.origin_mm, self.size_mm, following
            )
            self.points_added += added
            beyond += outside
            if following < count:
                self._make_room()
        if beyond:
            raise InputError(
                "points within {size_mm:.0f} m of the grid's origin",
                "{beyond} points farther away",
                "Check the scan's unit and pose, or take larger voxels.",
                where,
                size_mm=self.size_mm * 2**20 / 1000,
                beyond=beyond,
            )

    def clouds(self) -> Iterator[VoxelCloud]:
        """Give the fused points, a tile at a time where sums went to the store; the grid stays as it is."""
        for tile in self.tiles():
            yield self.cloud_of(tile)

    def tiles(self) -> list[int | None]:
        """Return what `cloud_of` takes one by one: the tiles in the store, or None where all is in memory."""
        if not self._tiles:
            return [None]
        self._spill()
        return [*sorted(self._tiles)]

    def cloud_of(self, tile: int | None) -> VoxelCloud:
        """Return the fused points of one of `tiles()`."""
        if tile is None:
            return self._cloud(self._table.voxels())
        assert self._store is not None
        return self._cloud(self._merged(self._store.read(tile)))

    def cloud(self) -> VoxelCloud:
        """Return all fused points at once."""
        return joined_clouds(list(self.clouds()))

    def _require_sizes(
        self, points: SingleArray, poses: FloatArray, weights: SingleArray, normals: SingleArray, where: str
    ) -> None:
        if points.ndim != 3 or points.shape[2] != 3:
            to_do = "Reshape the scan."
            raise InputError("rows of points (P, C, 3)", "shape {frame}", to_do, where, frame=points.shape)
        fits = poses.shape in ((len(points), 4, 4), (1, 4, 4))
        fits &= weights.shape in (points.shape[:2], (1, 1))
        wanted = (*points.shape[:2], self._table.attributes)
        fits &= normals.shape == wanted if self._table.attributes else True
        if not fits:
            raise InputError(
                "poses, weights and normals for {height}×{width} points",
                "shapes {poses}, {weights} and {normals}: a scan of another size",
                "Give the arrays of one scan together.",
                where,
                height=points.shape[0],
                width=points.shape[1],
                poses=poses.shape,
                weights=weights.shape,
                normals=normals.shape,
            )
        if not np.isfinite(weights).all():
            raise InputError("finite weights", "NaN or infinity", "Check the points' sigmas.", where)

    def _make_room(self) -> None:
        """Double the table, or where that is not allowed, give all sums to the store."""
        bricks = 2 * self._table.room
        if self._store is not None and bricks > self._most_bricks:
            self._spill()
            return
        before = self._table.bytes
        self._table = self._table.larger(bricks)
        self.peak_bytes = max(self.peak_bytes, before + self._table.bytes)

    def _record(self) -> np.dtype[np.void]:
        columns = 4 + self._table.attributes
        return np.dtype([("key", "<i8"), ("sums", "<f4", (columns,)), ("count", "<i4")])

    def _spill(self) -> None:
        """Give all sums to the store, by tiles, and begin anew with an empty table."""
        from calib_core.kernels.fusion import unpack_keys

        assert self._store is not None
        voxels = self._table.voxels()
        if not len(voxels.keys):
            return
        tiles = _tile_numbers(unpack_keys(voxels.keys))
        order = np.argsort(tiles, kind="stable")
        records = np.empty(len(order), dtype=self._record())
        records["key"], records["sums"], records["count"] = (column[order] for column in voxels)
        tiles = tiles[order]
        bounds = np.concatenate([[0], np.flatnonzero(np.diff(tiles)) + 1, [len(tiles)]])
        for start, end in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
            tile = int(tiles[start])
            self._store.append(tile, records[start:end].tobytes())
            self._tiles.add(tile)
        self.spills += 1
        self._table.clear()

    def _merged(self, data: bytes) -> Voxels:
        """Return the voxels of a tile's records, each once."""
        records = np.frombuffer(data, dtype=self._record())
        keys, which = np.unique(records["key"], return_inverse=True)
        sums = np.zeros((len(keys), records["sums"].shape[1]), dtype=np.float32)
        counts = np.zeros(len(keys), dtype=np.int32)
        np.add.at(sums, which, records["sums"])
        np.add.at(counts, which, records["count"])
        return Voxels(keys, sums, counts)

    def _cloud(self, voxels: Voxels) -> VoxelCloud:
        from calib_core.kernels.fusion import unpack_keys

        keys, sums, counts = voxels
        weight = sums[:, 3:4].astype(np.float64)
        points = (unpack_keys(keys) + sums[:, :3] / weight) * self.size_mm + self.origin_mm
        normals, coherence, intensity = np.empty((0, 3), np.float32), *np.empty((2, 0), np.float32)
        if self._table.attributes:
            lengths = np.linalg.norm(sums[:, 4:7], axis=1, keepdims=True)
            normals = sums[:, 4:7] / np.where(lengths > 0, lengths, np.nan).astype(np.float32)
            coherence = (lengths / weight)[:, 0].astype(np.float32)
        if self._table.attributes > 3:
            intensity = (sums[:, 7:] / weight)[:, 0].astype(np.float32)
        sigma = (1 / np.sqrt(weight[:, 0])).astype(np.float32)
        return VoxelCloud(points.astype(np.float32), sigma, counts, normals, keys, coherence, intensity)


def _tile_numbers(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return one number a tile of 256³ voxels, from voxel indices (N, 3)."""
    from calib_core.kernels.fusion import pack_keys

    return pack_keys(indices >> _TILE_BITS)
