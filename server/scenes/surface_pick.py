"""Where a click's ray meets the merged surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from server.scenes.cloud_layers import cloud_place, point_size_mm, shown_cloud
from server.scenes.display_options import Look
from server.scenes.nodes import METRES_PER_MM
from server.scenes.scene_model import SceneFacts

_WIDTHS = (1.5, 4.0)  # of the ray, in spacings of the points: the wide one where the narrow one meets none
_REACH = 6.0  # spacings: how far the plane of the nearest points may move what is picked
_NEAREST = 12
_STEEP = 0.1
_FEWEST = 3  # points that are a surface: one alone is a stray


@dataclass(frozen=True, eq=False)
class Ray:
    """From where (3,), mm, and which way (3,) a click goes."""

    origin_mm: FloatArray
    direction: FloatArray


def picked_on_cloud(
    facts: SceneFacts, look: Look, origin_m: FloatArray, direction: FloatArray
) -> FloatArray | None:
    """Return the point of the merged cloud, in its frame, that a click meets; None where it misses."""
    cloud, place = shown_cloud(facts, look), cloud_place(facts, look)
    if cloud is None or place is None or cloud.waiting:
        return None
    back = place.inverse()
    ray = Ray(back.apply(origin_m / METRES_PER_MM), back.rotation @ (direction / np.linalg.norm(direction)))
    points = cloud.points_mm
    if look.cloud.section is not None:
        points = points[look.cloud.section.keeps(points)]
    return met(points, ray, point_size_mm(cloud))


def met(points_mm: NDArray[np.floating], ray: Ray, spacing_mm: float) -> FloatArray | None:
    """Return where a ray meets the surface nearest to its origin that points (N, 3) so far apart lie on."""
    offsets = points_mm - ray.origin_mm
    along = offsets @ ray.direction
    squares = np.einsum("ij,ij->i", offsets, offsets) - along**2
    for width in _WIDTHS:
        hit = np.flatnonzero((squares <= (width * spacing_mm) ** 2) & (along > 0))
        depths = np.sort(along[hit])
        surface = depths[_FEWEST - 1 :] - depths[: len(depths) - _FEWEST + 1] <= 2 * width * spacing_mm
        if surface.any():
            first = float(depths[np.argmax(surface)])
            return _on_plane(points_mm, ray, first, _REACH * spacing_mm)
    return None


def _on_plane(points_mm: NDArray[np.floating], ray: Ray, depth_mm: float, reach_mm: float) -> FloatArray:
    """Return where the ray meets the plane of the points nearest to a depth; there where it runs along it."""
    place = ray.origin_mm + depth_mm * ray.direction
    for _ in range(2):
        squares = np.einsum("ij,ij->i", points_mm - place, points_mm - place)
        near = points_mm[np.argpartition(squares, min(_NEAREST, len(squares) - 1))[:_NEAREST]].astype(float)
        middle = near.mean(axis=0)
        normal = np.linalg.svd(near - middle, full_matrices=False)[2][2]
        steep = float(normal @ ray.direction)
        step = float(normal @ (middle - place)) / steep if abs(steep) > _STEEP else np.inf
        if abs(step) > reach_mm:
            break
        place = place + step * ray.direction
    return place
