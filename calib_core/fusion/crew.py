"""Who does the work of a merge: scans are cleaned one by one, and their points are summed region by region.

A region is a set of blocks of voxels, all over space.  Which points fall into it, and in which order they are
summed, depends on the scans alone, and so do its memory and what goes to the disk: whoever sums it, here or on a
cluster's workers, gets the same numbers bit for bit, in the same order.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.clean_scan import KEPT, CleanOptions, CleanScan
from calib_core.fusion.merge import SpillStore, VoxelCloud, VoxelGrid, joined_clouds
from calib_core.fusion.mesh import Mesh, sheet
from calib_core.fusion.outward import View, view_of
from calib_core.fusion.overlap import SeenBy, seen_by
from calib_core.fusion.scan import Scan

REGIONS = 16
_FIRST_BRICKS = 1 << 8
PATCH_VOXELS = 3.0

Tell = Callable[[int, str], None]
"""Is told of a scan that is begun: how many were before it, and its name."""


@dataclass(frozen=True)
class MergeOptions:
    """What is asked of a merge.

    Parameters
    ----------
    voxel_mm : float
    mesh : {"poisson", "grid", "none"}
    fill_holes : bool
        Whether the mesh is to be closed (Poisson alone).
    mesh_tolerance_mm : float, optional
        How far the mesh may move for fewer triangles.
    registration : bool
        Whether the scans may be moved after the overlap was measured.
    self_calibration : bool
        Whether tool and table, which the scans share, may be; where both are asked, the registration moves them.
    clean : CleanOptions
    patch_mm : float, optional
        Voxels in which scans are compared; three times `voxel_mm` if left out.
    most_bytes : int
        Memory for voxels, and again for a mesh; used with a store.
    intensity : bool
        Whether intensities are averaged, too.
    """

    voxel_mm: float = 0.5
    mesh: Literal["poisson", "grid", "none"] = "poisson"
    fill_holes: bool = False
    mesh_tolerance_mm: float | None = None
    registration: bool = False
    self_calibration: bool = False
    clean: CleanOptions = field(default_factory=CleanOptions)
    patch_mm: float | None = None
    most_bytes: int = 1_000_000_000
    intensity: bool = False

    @property
    def patch_size_mm(self) -> float:
        """The edge of the voxels in which scans are compared."""
        return self.patch_mm or PATCH_VOXELS * self.voxel_mm


@dataclass(frozen=True)
class ScanCounts:
    """How many points of a scan were kept, and dropped by reason."""

    points: int
    kept: int
    removed: dict[str, int]


@dataclass(frozen=True, eq=False)
class Extent:
    """How many points a cloud has, and the lowest and highest of their coordinates, (3,) mm."""

    points: int
    low_mm: FloatArray
    high_mm: FloatArray

    def joined(self, other: "Extent") -> "Extent":
        """Return the extent of both clouds."""
        low, high = np.minimum(self.low_mm, other.low_mm), np.maximum(self.high_mm, other.high_mm)
        return Extent(self.points + other.points, low, high)


@dataclass(frozen=True)
class ScanTask:
    """What is to be done with each scan: whether its points are summed, and moved before, (S, 4, 4) by number."""

    options: MergeOptions
    fuse: bool
    ways: Mapping[int, FloatArray] = field(default_factory=dict[int, FloatArray])


@dataclass(frozen=True, eq=False)
class ScanReport:
    """What is told of a scan: its counts, what it has seen and how, its sheet; or why it is of no use."""

    number: int
    name: str
    counts: ScanCounts | None = None
    seen: SeenBy | None = None
    view: View | None = None
    sheet: Mesh | None = None
    error: MeasurementError | None = None


class RegionPoints(NamedTuple):
    """Points of one scan that fall into one region, in their order: (N, 3), (N,), (N, 3).

    With intensities `normals` is (N, 4), each behind its normal.
    """

    points_mm: NDArray[np.float32]
    weights: NDArray[np.float32]
    normals: NDArray[np.float32]


def look_at(number: int, scan: Scan, task: ScanTask) -> tuple[ScanReport, list[RegionPoints]]:
    """Clean a scan; return what is told of it, and its points by region where they are to be summed."""
    way = task.ways.get(number)
    if way is not None:
        scan = replace(scan, turntable_from_laser=way @ scan.turntable_from_laser)
    try:
        clean = clean_scan(scan, task.options.clean)
    except MeasurementError as error:
        return ScanReport(number, scan.name, error=error), []
    report = ScanReport(
        number,
        scan.name,
        _counted(clean),
        seen_by(clean, task.options.patch_size_mm),
        view_of(scan),
        sheet(clean) if task.fuse and task.options.mesh == "grid" else None,
    )
    return report, by_region(clean, task.options) if task.fuse else []


def by_region(clean: CleanScan, options: MergeOptions) -> list[RegionPoints]:
    """Return a scan's kept points by region."""
    from calib_core.kernels import fusion

    normals = clean.normals
    if options.intensity:
        unknown = np.full(clean.verdicts.shape, np.nan, np.float32)
        bright = unknown if clean.intensity is None else clean.intensity
        normals = np.concatenate([normals, bright[..., None]], axis=2)
    # Strided and read-only arrays would each have a kernel of their own compiled.
    points, sigmas, normals = (
        np.require(one, np.float32, ["C", "W"]).reshape(-1, *one.shape[2:])
        for one in (clean.points_in_turntable_mm, clean.sigma_mm, normals)
    )
    kept = (clean.verdicts == KEPT).ravel()
    *columns, bounds = fusion.by_region(points, sigmas, normals, kept, options.voxel_mm, REGIONS)
    return [RegionPoints(*parts) for parts in zip(*(np.split(c, bounds[1:-1]) for c in columns), strict=True)]


class Crew(ABC):
    """Cleans scans and sums their points, and then holds the merged cloud.

    Attributes
    ----------
    facing : {1, -1}
        −1: the scans looked the other way than they were taken to, and the normals of the cloud are turned round.
    """

    facing = 1

    @abstractmethod
    def look_through(
        self, scans: Sequence[Scan], numbers: Sequence[int], task: ScanTask, tell: Tell
    ) -> Iterator[ScanReport]:
        """Clean scans of these numbers, and sum their points where that is asked; give what is told of each.

        Raises
        ------
        InputError
            If a scan cannot be read, or a point lies beyond the grid.
        """

    @property
    @abstractmethod
    def spills(self) -> int:
        """How often memory was emptied to the disk."""

    @abstractmethod
    def extent(self) -> Extent:
        """Return how far the merged cloud reaches."""

    @abstractmethod
    def pieces(self) -> Iterator[VoxelCloud]:
        """Give the merged cloud piece by piece, its normals as the scans were taken to look."""

    def clouds(self) -> Iterator[VoxelCloud]:
        """Give the merged cloud piece by piece, its normals outward."""
        for piece in self.pieces():
            yield piece if self.facing > 0 else replace(piece, normals=-piece.normals)

    def cloud(self) -> VoxelCloud:
        """Return the merged cloud at once."""
        return joined_clouds(list(self.clouds()))


class Alone(Crew):
    """This process does it all.

    Parameters
    ----------
    options : MergeOptions
    store : SpillStore, optional
        For more voxels than memory holds.
    """

    def __init__(self, options: MergeOptions, store: SpillStore | None = None) -> None:
        self._grids = RegionGrids(options, store)

    def look_through(
        self, scans: Sequence[Scan], numbers: Sequence[int], task: ScanTask, tell: Tell
    ) -> Iterator[ScanReport]:
        """Clean one scan after the other; see `Crew`."""
        for done, number in enumerate(numbers):
            scan = scans[number]
            tell(done, scan.name)
            report, parts = look_at(number, scan, task)
            self._grids.add(dict(enumerate(parts)), report.name)
            yield report

    @property
    def spills(self) -> int:
        """How often memory was emptied to the disk."""
        return self._grids.spills

    def extent(self) -> Extent:
        """Return how far the merged cloud reaches."""
        return self._grids.extent()

    def pieces(self) -> Iterator[VoxelCloud]:
        """Give the merged cloud piece by piece; see `Crew`."""
        for piece in self._grids.pieces():
            yield self._grids.cloud_of(*piece)


class RegionGrids:
    """The voxels of some regions.

    Parameters
    ----------
    options : MergeOptions
    store : SpillStore, optional
    regions : sequence of int
    """

    def __init__(
        self, options: MergeOptions, store: SpillStore | None, regions: Sequence[int] = range(REGIONS)
    ) -> None:
        self.scans = 0
        self._grids = {
            region: VoxelGrid(
                options.voxel_mm,
                normals=True,
                store=None if store is None else _RegionStore(store, region),
                most_bytes=options.most_bytes // REGIONS,
                first_bricks=_FIRST_BRICKS,
                intensity=options.intensity,
            )
            for region in regions
        }

    def __sizeof__(self) -> int:
        """Return the memory that the sums take, for those who plan by it."""
        return object.__sizeof__(self) + sum(grid.held_bytes for grid in self._grids.values())

    @property
    def spills(self) -> int:
        """How often memory was emptied to the disk."""
        return sum(grid.spills for grid in self._grids.values())

    def add(self, parts: Mapping[int, RegionPoints], where: str) -> None:
        """Sum the points of one scan, by region; raises InputError where one lies beyond the grid."""
        self.scans += 1
        for region, part in parts.items():
            if len(part.points_mm):
                self._grids[region].add(part.points_mm[None], None, part.weights[None], part.normals[None], where)

    def extent(self) -> Extent:
        """Return how far these regions' cloud reaches."""
        found = Extent(0, np.full(3, np.inf), np.full(3, -np.inf))
        for piece in self.pieces():
            cloud = self.cloud_of(*piece)
            if len(cloud):
                reach = Extent(len(cloud), cloud.points_mm.min(axis=0), cloud.points_mm.max(axis=0))
                found = found.joined(reach)
        return found

    def pieces(self) -> list[tuple[int, int | None]]:
        """Return what `cloud_of` takes one by one: regions with points, in order, and their tiles."""
        filled = [(region, grid) for region, grid in sorted(self._grids.items()) if not grid.is_empty]
        return [(region, tile) for region, grid in filled for tile in grid.tiles()]

    def cloud_of(self, region: int, tile: int | None) -> VoxelCloud:
        """Return one piece of the cloud."""
        return self._grids[region].cloud_of(tile)


@dataclass(frozen=True)
class _RegionStore:
    """One region's place in a store that regions share."""

    store: SpillStore
    region: int

    def append(self, tile: int, data: bytes) -> None:
        self.store.append(tile * REGIONS + self.region, data)

    def read(self, tile: int) -> bytes:
        return self.store.read(tile * REGIONS + self.region)


def _counted(clean: CleanScan) -> ScanCounts:
    removed = clean.removed()
    kept = int(np.count_nonzero(clean.verdicts == KEPT))
    return ScanCounts(kept + sum(removed.values()), kept, removed)
