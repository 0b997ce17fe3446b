"""The whole merge, scan after scan: clean, fuse, compare, register if asked, mesh; a table of contents."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib_core.errors import CalibrationError, InputError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.certainty import surface_sigma_mm
from calib_core.fusion.crew import Alone, Crew, Extent, MergeOptions, ScanCounts, ScanReport, ScanTask
from calib_core.fusion.mesh import Mesh, joined, poisson_mesh, turned_round
from calib_core.fusion.mesh_finish import closed, sharpened, thinned
from calib_core.fusion.outward import Outward, View, outward
from calib_core.fusion.overlap import Overlap, Patches, PoseErrors, SeenBy, joined_patches, overlap
from calib_core.fusion.register import Registration, register
from calib_core.fusion.scan import Scan
from calib_core.fusion.scatter import Scatter, scatter
from calib_core.fusion.self_calibration import SelfCalibration, self_calibration
from calib_core.messages import message

_CELLS_ACROSS = 40.0
"""Of the largest scan: voxels in which an arrangement that is nearly right makes pairs."""

Progress = Callable[[float, str], None]

_ONE_SURFACE = 3.0  # times the scans' distance: surfaces nearer to each other than that are one
_LEAST_APART = 0.05  # of a patch
_POISSON_BYTES = 1000  # a point, about: the octree and its system of equations


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


@dataclass(frozen=True, eq=False)
class Looked:
    """What scans show of how they fit together, before any of them is moved.

    Parameters
    ----------
    used : tuple of str
        Scans that are of use, in order.
    failed : dict
        The others, by name, and why.
    patches : Patches
    overlap : Overlap
        Rows of `per_scan` as `used`.
    outward : Outward
        Which way is out, and how that was decided.
    scatter : Scatter or None
        Of the poses, found from the overlap where nobody told it.
    directions : (S, 3)
        Of sight.
    """

    used: tuple[str, ...]
    failed: dict[str, MeasurementError]
    patches: Patches
    overlap: Overlap
    outward: Outward
    scatter: Scatter | None
    directions: FloatArray


@dataclass(frozen=True, eq=False)
class MergeSolution:
    """The merged cloud and its evidence.

    Parameters
    ----------
    grid : Crew
        All points, wherever they are, which must still be there to take them out.
    extent : Extent
    mesh : Mesh or None
    looked : Looked
        Before any registration.
    surface_sigma_mm : float
        Of a scan's surface along its normal, as it stands in T in the end.
    patches : Patches
        What the overlap was measured on; with registration, as it moved them.
    errors : PoseErrors
        What is left uncertain of the scans' places in the end.
    registration : Registration or None
    self_calibration : SelfCalibration or None
    counts : dict
        By scan.
    no_mesh : str
        Why there is none, though it was asked for.
    """

    grid: Crew
    extent: Extent
    mesh: Mesh | None
    looked: Looked
    surface_sigma_mm: float
    patches: Patches
    errors: PoseErrors
    registration: Registration | None
    self_calibration: SelfCalibration | None
    counts: dict[str, ScanCounts]
    no_mesh: str

    @property
    def used(self) -> tuple[str, ...]:
        """Scans that were merged, in order."""
        return self.looked.used

    @property
    def failed(self) -> dict[str, MeasurementError]:
        """Scans of no use, by name, and why."""
        return self.looked.failed

    @property
    def overlap(self) -> Overlap:
        """How far scans lie apart, before any registration."""
        return self.looked.overlap


def solve_merge(
    scans: Sequence[Scan],
    errors: PoseErrors | None = None,
    options: MergeOptions | None = None,
    progress: Progress | None = None,
    crew: Crew | None = None,
    ball: Literal[1, -1] | None = None,
    fits: Callable[[Looked], bool] | None = None,
) -> MergeSolution:
    """Return all scans in one cloud in T, how far they lie apart, and a mesh.

    Parameters
    ----------
    scans : sequence of Scan
        May read them one by one; each is asked for once, with registration twice.
    errors : PoseErrors, optional
        What the calibration leaves uncertain of each scan's place, for the overlap that is expected; found from
        the overlap where it is left out.
    options : MergeOptions, optional
    progress : callable, optional
        Called with the fraction done and what is being done; may raise to stop.
    crew : Crew, optional
        Who does the work; this process, with all voxels in memory, if left out.
    ball : {1, -1}, optional
        Which way captures of the ball say that z grows: 1 away from the scanner.
    fits : callable, optional
        Says whether the scans fit together; where they do not, nothing is registered, and there is no mesh.

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
        raise InputError("at least one scan", "none", "Add scans of the object.", "captures")
    grid = crew or Alone(o)
    moving = o.registration or o.self_calibration
    failed: dict[str, MeasurementError] = {}
    counts: dict[str, ScanCounts] = {}
    used: list[int] = []
    sheets: list[Mesh] = []
    first: list[tuple[str, SeenBy]] = []
    views: list[View] = []

    def begun(done: int, name: str) -> None:
        tell(0.6 * done / len(scans), _with_spills(grid, message("Cleaning and merging {name}", name=name)))

    for report in grid.look_through(scans, range(len(scans)), ScanTask(o, fuse=not moving), begun):
        if report.error is not None:
            failed[report.name] = report.error
            continue
        assert report.counts is not None
        assert report.seen is not None
        assert report.view is not None
        used.append(report.number)
        counts[report.name] = report.counts
        first.append((report.name, report.seen))
        views.append(report.view)
        _keep_sheet(sheets, report, o)
    if not first:
        raise next(iter(failed.values()))
    seen = joined_patches(first, o.patch_size_mm)
    if errors is not None:
        errors = PoseErrors(errors.common[used], errors.own[used])
    found = scatter(seen) if errors is None else None
    errors = found.errors if found else errors
    apart = overlap(found.with_noise(seen) if found else seen, errors)
    facing = outward(seen, views, _tolerance_mm(apart, seen), ball)
    grid.facing = facing.sign
    if facing.sign < 0:
        sheets = [turned_round(one) for one in sheets]
    directions = facing.sign * np.array([view.direction for view in views])
    looked = Looked(tuple(counts), failed, seen, apart, facing, found, directions)
    rubble = fits is not None and not fits(looked)
    registration, common, left = None, None, errors or PoseErrors.none(len(used))
    if moving:
        tell(0.6, "Registering the scans to each other")
        registration = register(found.for_registration(seen) if found else seen, errors) if not rubble else None
        self_calibrates = registration is not None and o.self_calibration and left.common.any()
        common = self_calibration(registration, left) if registration and self_calibrates else None
        if registration is None or not o.registration:
            ways, left = (common.turntable_from_scan, common.errors) if common else (_no_moves(len(used)), left)
            seen, registration = seen.transformed(ways), None
        else:
            ways, seen, left = registration.turntable_from_scan, registration.moved, registration.errors

        def again(done: int, name: str) -> None:
            tell(0.62 + 0.13 * done / len(used), _with_spills(grid, message("Merging {name}", name=name)))

        task = ScanTask(o, fuse=True, ways=dict(zip(used, ways, strict=True)))
        for report in grid.look_through(scans, used, task, again):
            if report.error is not None:
                raise report.error
            _keep_sheet(sheets, report, o, facing.sign)
    tell(0.75, "Gathering the points")
    extent = grid.extent()
    tell(0.8, "Building the mesh")
    mesh, no_mesh = (None, "") if rubble else _mesh(grid, extent, sheets, o)
    tell(1.0, "Merged")
    return MergeSolution(
        grid=grid,
        extent=extent,
        mesh=mesh,
        looked=looked,
        surface_sigma_mm=surface_sigma_mm(seen, left),
        patches=seen,
        errors=left,
        registration=registration,
        self_calibration=common,
        counts=counts,
        no_mesh=no_mesh,
    )


def _say_nothing(_fraction: float, _what: str) -> None:
    """Take progress that nobody asked for."""


def _no_moves(count: int) -> FloatArray:
    return np.tile(np.eye(4), (count, 1, 1))


def _with_spills(grid: Crew, doing: str) -> str:
    if not grid.spills:
        return doing
    return message("{doing} (memory was emptied to the disk {times} times)", doing=doing, times=grid.spills)


def _tolerance_mm(apart: Overlap, seen: Patches) -> float:
    known = _ONE_SURFACE * apart.rms_mm if apart.pairs else 0.0
    return max(known, _LEAST_APART * seen.size_mm)


def _keep_sheet(sheets: list[Mesh], report: ScanReport, options: MergeOptions, facing: int = 1) -> None:
    if report.sheet is not None and _mesh_bytes(sheets) <= options.most_bytes:
        sheets.append(report.sheet if facing > 0 else turned_round(report.sheet))


def _mesh_bytes(sheets: Sequence[Mesh]) -> int:
    return sum(one.points_mm.nbytes + one.triangles.nbytes for one in sheets)


def _mesh(grid: Crew, extent: Extent, sheets: Sequence[Mesh], options: MergeOptions) -> tuple[Mesh | None, str]:
    """Return the mesh that is asked for; without one, and why not, where the points do not give it."""
    if options.mesh == "none":
        return None, ""
    needed = _POISSON_BYTES * extent.points if options.mesh == "poisson" else _mesh_bytes(sheets)
    if grid.spills and needed > options.most_bytes:
        to_do = "Allow more memory (cell.merge.memory_mb), take larger voxels, or cell.merge.mesh = none."
        return None, message("it would need more than the memory allowed. {advice}", advice=to_do)
    try:
        if options.mesh == "grid":
            mesh = joined(sheets)
        else:
            cloud = grid.cloud()
            mesh = poisson_mesh(cloud, options.voxel_mm, options.fill_holes)
            mesh = sharpened(mesh, cloud, options.voxel_mm)
            mesh = closed(mesh) if options.fill_holes else mesh
        return thinned(mesh, options.mesh_tolerance_mm) if options.mesh_tolerance_mm else mesh, ""
    except CalibrationError as error:
        return None, error.reason


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
