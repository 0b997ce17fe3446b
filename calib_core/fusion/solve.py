"""The whole merge, scan after scan: clean, fuse, compare, register if asked, mesh; a table of contents."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from calib_core.errors import CalibrationError, InputError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.certainty import surface_sigma_mm
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.clean_scan import KEPT, CleanOptions, CleanScan
from calib_core.fusion.merge import SpillStore, VoxelGrid
from calib_core.fusion.mesh import Mesh, joined, poisson_mesh, sheet
from calib_core.fusion.overlap import Overlap, Patches, PoseErrors, overlap, patches
from calib_core.fusion.register import Registration, register
from calib_core.fusion.scan import Scan
from calib_core.fusion.self_calibration import SelfCalibration, self_calibration

Progress = Callable[[float, str], None]

_PATCH_VOXELS = 3.0
_POISSON_BYTES = 1000  # a point, about: the octree and its system of equations


@dataclass(frozen=True)
class MergeOptions:
    """What is asked of a merge.

    Parameters
    ----------
    voxel_mm : float
    mesh : {"poisson", "grid", "none"}
    registration : bool
        Whether the scans may be moved after the overlap was measured.
    self_calibration : bool
        Whether tool and table, which the scans share, may be; where both are asked, the registration moves them.
    clean : CleanOptions
    patch_mm : float, optional
        Voxels in which scans are compared; three times `voxel_mm` if left out.
    most_bytes : int
        Memory for voxels, and again for a mesh; used with a store.
    """

    voxel_mm: float = 0.5
    mesh: Literal["poisson", "grid", "none"] = "poisson"
    registration: bool = False
    self_calibration: bool = False
    clean: CleanOptions = field(default_factory=CleanOptions)
    patch_mm: float | None = None
    most_bytes: int = 1_000_000_000


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


@dataclass(frozen=True, eq=False)
class MergeSolution:
    """The merged cloud and its evidence.

    Parameters
    ----------
    grid : VoxelGrid
        All points, in memory or in the store, which must still be there to take them out.
    extent : Extent
    mesh : Mesh or None
    overlap : Overlap
        Before any registration; rows of `per_scan` as `used`.
    surface_sigma_mm : float
        Of a scan's surface along its normal, as it stands in T in the end.
    patches : Patches
        What the overlap was measured on; with registration, as it moved them.
    errors : PoseErrors
        What is left uncertain of the scans' places in the end.
    registration : Registration or None
    self_calibration : SelfCalibration or None
    used : tuple of str
        Scans that were merged, in order.
    failed : dict
        Scans of no use, by name, and why.
    counts : dict
        By scan.
    warnings : tuple of str
    """

    grid: VoxelGrid
    extent: Extent
    mesh: Mesh | None
    overlap: Overlap
    surface_sigma_mm: float
    patches: Patches
    errors: PoseErrors
    registration: Registration | None
    self_calibration: SelfCalibration | None
    used: tuple[str, ...]
    failed: dict[str, MeasurementError]
    counts: dict[str, ScanCounts]
    warnings: tuple[str, ...]


def solve_merge(
    scans: Sequence[Scan],
    errors: PoseErrors | None = None,
    options: MergeOptions | None = None,
    progress: Progress | None = None,
    store: SpillStore | None = None,
) -> MergeSolution:
    """Return all scans in one cloud in T, how far they lie apart, and a mesh.

    Parameters
    ----------
    scans : sequence of Scan
        May read them one by one; each is asked for once, with registration twice.
    errors : PoseErrors, optional
        What the calibration leaves uncertain of each scan's place, for the overlap that is expected.
    options : MergeOptions, optional
    progress : callable, optional
        Called with the fraction done and what is being done; may raise to stop.
    store : SpillStore, optional
        For more voxels than memory holds.

    Raises
    ------
    InputError
        If there are no scans.
    MeasurementError
        If no scan has points on a surface.
    """
    o = options or MergeOptions()
    tell = progress or _say_nothing
    if not scans:
        raise InputError("at least one scan", "none", "Scan the object and add the captures.", "captures")
    grid = VoxelGrid(o.voxel_mm, normals=True, store=store, most_bytes=o.most_bytes)
    moving = o.registration or o.self_calibration
    failed: dict[str, MeasurementError] = {}
    counts: dict[str, ScanCounts] = {}
    used: list[int] = []
    sheets: list[Mesh] = []

    def take(clean: CleanScan) -> None:
        grid.add(clean.points_in_turntable_mm, None, clean.weights, clean.normals, clean.name)
        if o.mesh == "grid" and _mesh_bytes(sheets) <= o.most_bytes:
            sheets.append(sheet(clean))

    def cleaned() -> Iterator[CleanScan]:
        for number, scan in enumerate(scans):
            tell(0.6 * number / len(scans), f"Cleaning and merging {scan.name}{_on_disk(grid)}")
            try:
                clean = clean_scan(scan, o.clean)
            except MeasurementError as error:
                failed[scan.name] = error
                continue
            used.append(number)
            counts[scan.name] = _counted(clean)
            if not moving:
                take(clean)
            yield clean

    try:
        seen = patches(cleaned(), o.patch_mm or _PATCH_VOXELS * o.voxel_mm)
    except InputError:
        if not failed:
            raise
        raise next(iter(failed.values())) from None
    if errors is not None:
        errors = PoseErrors(errors.common[used], errors.own[used])
    apart = overlap(seen, errors)
    registration, common, left = None, None, errors or PoseErrors.none(len(used))
    if moving:
        tell(0.6, "Registering the scans to each other")
        registration = register(seen, errors)
        common = self_calibration(registration, left) if o.self_calibration and left.common.any() else None
        if not o.registration:
            ways, left = (common.turntable_from_scan, common.errors) if common else (_no_moves(len(used)), left)
            seen, registration = seen.transformed(ways), None
        else:
            ways, seen, left = registration.turntable_from_scan, registration.moved, registration.errors
        for done, (number, move) in enumerate(zip(used, ways, strict=True)):
            scan = scans[number]
            tell(0.62 + 0.13 * done / len(used), f"Merging {scan.name}{_on_disk(grid)}")
            take(clean_scan(_moved(scan, move), o.clean))
    tell(0.75, "Gathering the points")
    extent = _extent(grid)
    tell(0.8, "Building the mesh")
    mesh, warnings = _mesh(grid, extent, sheets, o)
    tell(1.0, "Merged")
    return MergeSolution(
        grid=grid,
        extent=extent,
        mesh=mesh,
        overlap=apart,
        surface_sigma_mm=surface_sigma_mm(seen, left),
        patches=seen,
        errors=left,
        registration=registration,
        self_calibration=common,
        used=tuple(counts),
        failed=failed,
        counts=counts,
        warnings=tuple(warnings),
    )


def _say_nothing(_fraction: float, _what: str) -> None:
    """Take progress that nobody asked for."""


def _counted(clean: CleanScan) -> ScanCounts:
    removed = clean.removed()
    kept = int(np.count_nonzero(clean.verdicts == KEPT))
    return ScanCounts(kept + sum(removed.values()), kept, removed)


def _no_moves(count: int) -> FloatArray:
    return np.tile(np.eye(4), (count, 1, 1))


def _moved(scan: Scan, turntable_from_scan: FloatArray) -> Scan:
    return replace(scan, turntable_from_laser=turntable_from_scan @ scan.turntable_from_laser)


def _on_disk(grid: VoxelGrid) -> str:
    return f" (memory was emptied to the disk {grid.spills} times)" if grid.spills else ""


def _extent(grid: VoxelGrid) -> Extent:
    points, low, high = 0, np.full(3, np.inf), np.full(3, -np.inf)
    for cloud in grid.clouds():
        points += len(cloud)
        low, high = np.minimum(low, cloud.points_mm.min(axis=0)), np.maximum(high, cloud.points_mm.max(axis=0))
    return Extent(points, low, high)


def _mesh_bytes(sheets: Sequence[Mesh]) -> int:
    return sum(one.points_mm.nbytes + one.triangles.nbytes for one in sheets)


def _mesh(
    grid: VoxelGrid, extent: Extent, sheets: Sequence[Mesh], options: MergeOptions
) -> tuple[Mesh | None, list[str]]:
    """Return the mesh that is asked for; without one, and why not, where the points do not give it."""
    if options.mesh == "none":
        return None, []
    needed = _POISSON_BYTES * extent.points if options.mesh == "poisson" else _mesh_bytes(sheets)
    if grid.spills and needed > options.most_bytes:
        to_do = "Allow more memory (cell.merge.memory_mb), take larger voxels, or cell.merge.mesh = none."
        return None, [f"No mesh: it would need more than the memory allowed. {to_do}"]
    try:
        if options.mesh == "grid":
            return joined(sheets), []
        return poisson_mesh(grid.cloud(), options.voxel_mm), []
    except CalibrationError as error:
        return None, [f"No mesh: need {error.need}, got {error.got}. {error.to_do}"]
