"""What a simulated scanner looks at: where rays meet a part's mesh, or a sphere that is exact."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calib_core.lean_open3d import open3d
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.part import PartMesh


class Surface(Protocol):
    """Something that rays meet."""

    def cast(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return distance (inf where nothing is met) and outward normal (…, 3) of rays (…, 3), directions unit."""
        ...


class MeshSurface:
    """A mesh; the ray tracer is set up once."""

    def __init__(self, part: PartMesh) -> None:
        o3d = open3d()
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        points = o3d.core.Tensor.from_numpy(part.points_mm.astype(np.float32))
        self._scene.add_triangles(points, o3d.core.Tensor.from_numpy(part.triangles.astype(np.uint32)))

    def cast(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return distance and normal where rays meet the mesh first."""
        o3d = open3d()
        rays = np.concatenate([origins, directions], axis=-1).astype(np.float32)
        found = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)
        normals = found["primitive_normals"].numpy().astype(float)
        return found["t_hit"].numpy().astype(float), normals


@dataclass(frozen=True, eq=False)
class Ball:
    """A sphere in T, seen as it is and not as triangles."""

    center_mm: FloatArray
    radius_mm: float

    def cast(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return distance and normal where rays from outside meet the sphere first."""
        offset = origins - self.center_mm
        along = (offset * directions).sum(axis=-1)
        inside = along**2 - (offset**2).sum(axis=-1) + self.radius_mm**2
        distance = -along - np.sqrt(np.maximum(inside, 0.0))
        distance = np.where((inside > 0) & (distance > 0), distance, np.inf)
        met = origins + np.where(np.isfinite(distance), distance, 0.0)[..., None] * directions
        return distance, (met - self.center_mm) / self.radius_mm
