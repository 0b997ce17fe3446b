"""Cleaning: normals, stray points, mixed points at edges and grazing angles, on the scan's own grid.

A scanner delivers its points in rows; a point's neighbours on the object are its neighbours in the rows, so
nothing needs to be searched.  Through the neighbours in 5×5 (those near enough to be on the same surface) a plane
is fitted without the point itself; the point's distance from it judges the point, and it gives the normal.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from calib_core.errors import MeasurementError
from calib_core.fusion.clean_scan import KEPT, CleanOptions, CleanScan, SingleArray
from calib_core.fusion.scan import Scan

_BORDER = 2


def clean_scan(scan: Scan, options: CleanOptions | None = None) -> CleanScan:
    """Return a scan in T with its normals and a verdict on each point.

    Parameters
    ----------
    scan : Scan
        On its grid; a cloud without one is cleaned by its nearest neighbours in space instead.
    options : CleanOptions, optional

    Raises
    ------
    MeasurementError
        If no point of the scan is kept.
    """
    o = options or CleanOptions()
    if scan.organised and min(scan.points_in_laser_mm.shape[:2]) >= 3:
        cleaned = _clean_grid(scan, o)
    else:
        from calib_core.fusion.clean_cloud import clean_unordered

        cleaned = clean_unordered(scan, o)
    if not (cleaned.verdicts == KEPT).any():
        got = ", ".join(f"{count} {name}" for name, count in cleaned.removed().items())
        raise MeasurementError(
            "points on a surface",
            "none among {points_in_laser_mm:g} points ({found})",
            "Check that rows and columns are the scan's own, and its poses; or exclude it.",
            scan.name,
            points_in_laser_mm=np.isfinite(scan.points_in_laser_mm[..., 2]).sum(),
            found=got,
        )
    return replace(cleaned, intensity=scan.intensity)


def _clean_grid(scan: Scan, o: CleanOptions) -> CleanScan:
    from calib_core.kernels.grid import judge_grid, rejudge_near_strays, to_planes

    rows, columns = scan.points_in_laser_mm.shape[:2]
    planes = np.full((3, rows + 2 * _BORDER, columns + 2 * _BORDER), np.nan, dtype=np.float32)
    # Strided and read-only arrays would each have a kernel of their own compiled.
    points = np.require(scan.points_in_laser_mm, None, ["C", "W"])
    to_planes(points, np.require(scan.turntable_from_laser[:, :3], None, ["C", "W"]), planes)
    least = float(np.cos(np.deg2rad(o.grazing_deg)))
    inner = planes[:, _BORDER:-_BORDER, _BORDER:-_BORDER]
    reach2 = _reach2(inner, least, scan.point_sigma_mm)
    rays = np.ascontiguousarray(np.broadcast_to(scan.sight, (rows, 3)), dtype=np.float32)
    verdicts = np.empty((rows, columns), np.uint8)
    normals = np.empty((3, rows, columns), np.float32)
    cosines = np.empty((rows, columns), np.float32)
    given = (scan.point_sigma_mm, o.stray_cut, float(o.fewest_neighbours), least)
    bounds = np.linspace(0, rows, 4 * o.workers + 1).astype(int).tolist()

    def judge(part: int) -> None:
        judge_grid(planes, reach2, rays, given, bounds[part], bounds[part + 1], verdicts, normals, cosines)

    with ThreadPoolExecutor(o.workers) as pool:
        list(pool.map(judge, range(4 * o.workers)))
    rejudge_near_strays(planes, reach2, rays, given, verdicts, normals, cosines)
    variance = np.square(np.float32(scan.point_sigma_mm) / np.maximum(cosines, np.float32(least)))
    variance += np.float32(scan.position_sigma_mm**2)
    return CleanScan(
        scan.name,
        np.stack(list(inner), axis=-1),
        np.stack(list(normals), axis=-1),
        verdicts,
        np.sqrt(variance),
        scan.point_sigma_mm,
        float(np.sqrt(reach2[2, 3:].min())),
    )


def _reach2(planes: SingleArray, least_cosine: float, sigma_mm: float) -> SingleArray:
    """Return the squared distance (5, 5) to a neighbour on the same surface, seen as obliquely as is believed."""
    row_mm, column_mm = _step(planes[:, :, ::16], 1), _step(planes[:, ::16, :], 2)
    offsets = np.arange(-_BORDER, _BORDER + 1)
    flat = np.hypot(offsets[:, None] * row_mm, offsets[None, :] * column_mm)
    return ((flat / least_cosine + 4 * sigma_mm) ** 2).astype(np.float32)


def _step(planes: SingleArray, axis: int) -> float:
    """Return the usual distance between neighbours along rows (axis 1) or columns (axis 2); 0 where none are."""
    distances = np.linalg.norm(np.diff(planes, axis=axis), axis=0)
    known = distances[np.isfinite(distances)]
    return float(np.median(known)) if known.size else 0.0
