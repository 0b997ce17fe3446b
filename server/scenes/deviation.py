"""The merged cloud's deviations from a reference, as the scene colours by them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import CalibrationError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.deviation import Deviations, mesh_deviations, sphere_deviations
from calib_core.fusion.sharp_edges import near_sharp_edges
from calib_core.messages import message
from server.scenes.cloud_view import Against
from server.scenes.colors import residual_limit_mm


@dataclass(frozen=True, eq=False)
class ReferenceMesh:
    """A mesh that says what the object should be: corners (C, 3) in the cloud's frame, triangles (M, 3).

    `tolerance_mm` is how far the object may lie off it, where that was told.  With `voxel_mm`, that of the cloud,
    points within a voxel of the mesh's edges count as beside it: means across an edge lie on no face.
    """

    corners_mm: NDArray[np.floating]
    triangles: NDArray[np.integer]
    tolerance_mm: float | None = None
    voxel_mm: float | None = None


@dataclass(frozen=True, eq=False)
class CloudDeviation:
    """Signed distances (N,) of the cloud's points; NaN beside the reference.

    `limit_mm` is the scale's end, `words` say what they are distances to, `of` gives the distances of further
    points (K, 3) to the same reference.  With `tolerance_mm` colours go by bands of it.
    """

    values_mm: FloatArray
    limit_mm: float
    words: str
    found: Deviations
    of: Callable[[NDArray[np.floating]], FloatArray]
    tolerance_mm: float | None = None


def cloud_deviation(
    points_mm: NDArray[np.floating], against: Against, reference: ReferenceMesh | None
) -> CloudDeviation:
    """Return the deviations of the cloud's points (N, 3).

    Raises
    ------
    MeasurementError
        If there is no such sphere in the cloud, or no reference mesh is given.
    """
    if against.kind == "sphere":
        return _from_sphere(points_mm, against.diameter_mm)
    if reference is None:
        to_do = "Add one as STL, PLY or OBJ under Result, Merge."
        raise MeasurementError("a reference mesh", "none", to_do, "reference")
    return _from_mesh(points_mm, reference)


class KeptDeviations:
    """The last deviations, computed again only for another cloud or reference."""

    def __init__(self) -> None:
        self._known: tuple[NDArray[np.floating], Against, ReferenceMesh | None, CloudDeviation | str] | None = None

    def of(
        self, points_mm: NDArray[np.floating], against: Against, reference: ReferenceMesh | None
    ) -> CloudDeviation | str:
        """Return `cloud_deviation`, or the sentence why there is none.

        The same cloud and reference are known by being the same objects.
        """
        known = self._known
        if known is None or known[0] is not points_mm or known[1] != against or known[2] is not reference:
            try:
                found = cloud_deviation(points_mm, against, reference)
            except CalibrationError as error:
                found = message("No deviations: {error}", error=error)
            known = (points_mm, against, reference, found)
            self._known = known
        return known[3]


def _from_mesh(points_mm: NDArray[np.floating], reference: ReferenceMesh) -> CloudDeviation:
    def of(points: NDArray[np.floating]) -> FloatArray:
        return mesh_deviations(points, reference.corners_mm, reference.triangles).values_mm

    found = mesh_deviations(points_mm, reference.corners_mm, reference.triangles)
    if reference.voxel_mm:
        corners_mm = np.asarray(reference.corners_mm, dtype=float)
        at_edges = near_sharp_edges(points_mm, corners_mm, reference.triangles, reference.voxel_mm)
        if not at_edges.all():
            found = Deviations(np.where(at_edges, np.nan, found.values_mm))
    return replace(_of(found, message("the reference mesh"), of), tolerance_mm=reference.tolerance_mm)


def _from_sphere(points_mm: NDArray[np.floating], diameter_mm: float | None) -> CloudDeviation:
    found = sphere_deviations(points_mm, diameter_mm)
    center, radius_mm = found.center_mm, found.radius_mm
    assert center is not None
    assert radius_mm is not None
    farthest = found.largest_mm(1.0)

    def of(points: NDArray[np.floating]) -> FloatArray:
        values = np.linalg.norm(points.astype(float) - center, axis=1) - radius_mm
        return np.where(np.abs(values) <= farthest, values, np.nan)

    said = message("the sphere, diameter {diameter_mm:.3f} mm as known", diameter_mm=2 * radius_mm)
    if diameter_mm is None:
        said = message("the sphere, diameter {diameter_mm:.3f} mm by best fit", diameter_mm=2 * radius_mm)
    return _of(found, said, of)


def _of(found: Deviations, words: str, of: Callable[[NDArray[np.floating]], FloatArray]) -> CloudDeviation:
    values = found.values_mm
    limit_mm = residual_limit_mm([values[np.isfinite(values)]])
    return CloudDeviation(values, limit_mm, words, found, of)
