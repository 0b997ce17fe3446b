"""How far points lie off a reference: a mesh that says what the object should be, or a sphere on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.lean_open3d import open3d
from calib_core.sphere.cloud import fit_sphere

_BLOCK = 200_000
_OF_THE_SPHERE = 6.0  # robust sigmas off the sphere within which a point is taken to be of it


@dataclass(frozen=True, eq=False)
class Deviations:
    """Signed distances of points to a reference, positive outside.

    Parameters
    ----------
    values_mm : (N,)
        NaN for points that are not of the reference (beside the sphere).
    center_mm : (3,) or None
        Of the sphere.
    radius_mm : float or None
    """

    values_mm: FloatArray
    center_mm: FloatArray | None = None
    radius_mm: float | None = None

    @property
    def counted(self) -> int:
        """How many points are of the reference."""
        return int(np.isfinite(self.values_mm).sum())

    @property
    def mean_mm(self) -> float:
        """Mean of the distances."""
        return float(np.nanmean(self.values_mm))

    @property
    def rms_mm(self) -> float:
        """Root mean square of the distances."""
        return float(np.sqrt(np.nanmean(self.values_mm**2)))

    def largest_mm(self, share: float) -> float:
        """Return the distance, in either direction, that a share of the points does not exceed."""
        return float(np.nanquantile(np.abs(self.values_mm), share))


class Nominal:
    """A triangle mesh that says what the object should be, asked for its places nearest to points.

    Parameters
    ----------
    corners_mm : (C, 3)
    triangles : (M, 3) int
        Corners of each triangle, counter-clockwise from outside; the mesh may be open.

    Raises
    ------
    InputError
        If there is no triangle.
    """

    def __init__(self, corners_mm: ArrayLike, triangles: ArrayLike) -> None:
        o3d = open3d()
        faces = np.ascontiguousarray(triangles, dtype=np.uint32)
        if not len(faces):
            to_do = "Export the reference as a mesh, not as a cloud."
            raise InputError("a mesh with triangles", "none", to_do, "mesh")
        corners = np.asarray(corners_mm, dtype=np.float64)
        self.middle_mm: FloatArray = corners.mean(axis=0)  # single precision holds well about the middle
        self.corners_mm: FloatArray = corners
        self.extent_mm = float(np.linalg.norm(np.ptp(corners, axis=0)))
        """Its diagonal."""
        self.triangles = faces
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        near = np.ascontiguousarray(corners - self.middle_mm, dtype=np.float32)
        self._scene.add_triangles(o3d.core.Tensor.from_numpy(near), o3d.core.Tensor.from_numpy(faces))

    def away(self, points_mm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return for points (N, 3) the way from their nearest places (N, 3), and the normals there (N, 3)."""
        o3d = open3d()
        points = np.asarray(points_mm, dtype=np.float64)
        away, normals = np.empty((len(points), 3)), np.empty((len(points), 3))
        for start in range(0, len(points), _BLOCK):
            block = np.ascontiguousarray(points[start : start + _BLOCK] - self.middle_mm, dtype=np.float32)
            found = self._scene.compute_closest_points(o3d.core.Tensor.from_numpy(block), nthreads=1)
            away[start : start + _BLOCK] = block - found["points"].numpy()
            normals[start : start + _BLOCK] = found["primitive_normals"].numpy()
        return away, normals

    def distances_mm(self, points_mm: ArrayLike) -> FloatArray:
        """Return the distances (N,) of points, positive on the side of the nearest triangle's normal."""
        away, normals = self.away(points_mm)
        outside = np.einsum("ij,ij->i", away, normals) >= 0
        return np.where(outside, 1.0, -1.0) * np.linalg.norm(away, axis=1)

    def spread(self, count: int, seed: int = 0) -> tuple[FloatArray, FloatArray]:
        """Return points (N, 3) spread evenly over its area, and the normals there (N, 3)."""
        rng = np.random.default_rng(seed)
        a, b, c = (self.corners_mm[self.triangles[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        area = np.linalg.norm(across, axis=1)
        chosen = rng.choice(len(area), count, p=area / area.sum())
        u, v = np.sqrt(rng.random(count))[:, None], rng.random(count)[:, None]
        points = (1 - u) * a[chosen] + u * (1 - v) * b[chosen] + u * v * c[chosen]
        return points, across[chosen] / area[chosen, None]


def mesh_deviations(points_mm: ArrayLike, corners_mm: ArrayLike, triangles: ArrayLike) -> Deviations:
    """Return the distances of points to a triangle mesh.

    Parameters
    ----------
    points_mm : (N, 3)
    corners_mm : (C, 3)
        In the points' own frame.
    triangles : (M, 3) int
        As of `Nominal`.

    Raises
    ------
    InputError
        If there is no triangle.
    """
    return Deviations(Nominal(corners_mm, triangles).distances_mm(points_mm))


def plane_cut(corners_mm: FloatArray, triangles: NDArray[np.integer], at_mm: float) -> FloatArray:
    """Return where a plane across the third axis cuts a mesh, as lines (L, 2, 2) in the other two."""
    side = corners_mm[:, 2] - at_mm
    above = side[triangles] > 0
    cut, above = triangles[above.any(axis=1) & ~above.all(axis=1)], above[above.any(axis=1) & ~above.all(axis=1)]
    alone = np.argmax(above == (above.sum(axis=1, keepdims=True) == 1), axis=1)
    rows = np.arange(len(cut))
    first = cut[rows, alone]
    ends: list[FloatArray] = []
    for step in (1, 2):
        other = cut[rows, (alone + step) % 3]
        share = (side[first] / (side[first] - side[other]))[:, None]
        ends.append((corners_mm[first] + share * (corners_mm[other] - corners_mm[first]))[:, :2])
    return np.stack(ends, axis=1)


def sphere_deviations(points_mm: ArrayLike, diameter_mm: float | None = None) -> Deviations:
    """Return the distances of points to the sphere that is found among them; others than the sphere's are NaN.

    Parameters
    ----------
    points_mm : (N, 3)
    diameter_mm : float, optional
        The sphere's known diameter; the best fit's where it is left out.

    Raises
    ------
    MeasurementError
        If there is no sphere, or none of this diameter.
    """
    points = np.asarray(points_mm, dtype=np.float64)
    fit = fit_sphere(points, diameter_mm)
    values = np.linalg.norm(points - fit.center_mm, axis=1) - fit.radius_mm
    near = np.abs(values) <= _OF_THE_SPHERE * max(fit.point_sigma_mm, fit.rms_mm)
    return Deviations(np.where(near, values, np.nan), fit.center_mm, fit.radius_mm)


def histogram(values_mm: FloatArray, limit_mm: float, bins: int = 41) -> NDArray[np.int64]:
    """Return how many of the values lie in even bins from −limit to +limit; those beyond are in the end bins."""
    inside = np.clip(values_mm[np.isfinite(values_mm)], -limit_mm, limit_mm)
    return np.histogram(inside, bins=bins, range=(-limit_mm, limit_mm))[0]
