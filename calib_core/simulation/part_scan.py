"""The simulated part seen by a laser scanner: rays from the light, occlusion on the way to the camera, its errors.

A scan is a sweep: the scanner moves along y of L in equal steps, with a profile at each.  A point is measured
where a ray of the plane of light meets the part first, and where the camera, beside the plane, sees it too.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.simulation.motion import FloatArray
from calib_core.simulation.part import PartMesh
from calib_core.simulation.surfaces import MeshSurface, Surface


@dataclass(frozen=True)
class PartScanOptions:
    """The scanner and its errors; lengths in mm.

    Parameters
    ----------
    pitch_mm : float
        Between columns (at 200 mm) and between profiles.
    width_mm, length_mm : float
        Of the stripe at 200 mm, and of the sweep.
    baseline_mm : float
        From the light to the camera, along y of L.
    point_sigma_mm : float
        Of a point's distance to the surface, seen head-on; the error acts along the ray and grows with 1/cosine.
    grazing_deg : float
        At larger angles of incidence nothing comes back.
    stray_fraction : float
        Points that come back from anywhere, of all rays.
    mixed_fraction : float
        At a jump of depth, how often the last point before it lies between both sides.
    """

    pitch_mm: float = 0.5
    width_mm: float = 130.0
    length_mm: float = 130.0
    baseline_mm: float = 80.0
    point_sigma_mm: float = 0.02
    grazing_deg: float = 82.0
    stray_fraction: float = 0.002
    mixed_fraction: float = 0.5


@dataclass(frozen=True, eq=False)
class PartScan:
    """One scan of the part.

    Parameters
    ----------
    points_in_laser_mm : (P, C, 3)
        As measured, x and z in the plane of light (y = 0); NaN where nothing came back.
    turntable_from_laser : (P, 4, 4)
        Where the scanner really was at each profile.
    true_points_mm : (P, C, 3)
        Where each ray met the part, in T.
    strays, mixed : (P, C) bool
        Points that lie on no surface.
    """

    points_in_laser_mm: FloatArray
    turntable_from_laser: FloatArray
    true_points_mm: FloatArray
    strays: np.ndarray
    mixed: np.ndarray


class PartScanner:
    """A scanner in front of a part or another surface."""

    def __init__(self, part: PartMesh | Surface, options: PartScanOptions | None = None) -> None:
        self.options = options or PartScanOptions()
        self._cast = (MeshSurface(part) if isinstance(part, PartMesh) else part).cast

    def scan(self, turntable_from_middle: FloatArray, rng: np.random.Generator) -> PartScan:
        """Return the scan whose middle profile is taken at a pose (4, 4); the errors are drawn from `rng`."""
        o = self.options
        poses = self._poses(turntable_from_middle)
        columns = round(o.width_mm / o.pitch_mm) + 1
        x_at_200 = (np.arange(columns) - (columns - 1) / 2) * o.pitch_mm
        rays = np.stack([x_at_200, np.zeros(columns), np.full(columns, 200.0)], axis=1)
        rays /= np.sqrt((rays**2).sum(axis=1, keepdims=True))
        distance, cosine = self._first_hits(poses, rays)
        hit = distance[..., None] * rays
        seen = np.isfinite(distance) & (cosine > np.cos(np.deg2rad(o.grazing_deg)))
        seen &= self._camera_sees(poses, hit, seen)
        true = np.einsum("pij,pcj->pci", poses[:, :3, :3], hit) + poses[:, None, :3, 3]
        error = rng.standard_normal(distance.shape) * o.point_sigma_mm / np.maximum(cosine, 0.05)
        measured = np.where(seen, distance + error, np.nan)
        mixed = self._mix(measured, cosine, rng)
        strays = rng.random(distance.shape) < o.stray_fraction
        measured[strays] = rng.uniform(120.0, 280.0, int(strays.sum()))
        true[~(seen | strays)] = np.nan
        return PartScan(measured[..., None] * rays, poses, true, strays, mixed & ~strays)

    def _poses(self, middle: FloatArray) -> FloatArray:
        count = round(self.options.length_mm / self.options.pitch_mm) + 1
        poses = np.tile(middle, (count, 1, 1))
        along = (np.arange(count) - (count - 1) / 2) * self.options.pitch_mm
        poses[:, :3, 3] += along[:, None] * middle[:3, 1]
        return poses

    def _first_hits(self, poses: FloatArray, rays: FloatArray) -> tuple[FloatArray, FloatArray]:
        directions = np.einsum("pij,cj->pci", poses[:, :3, :3], rays)
        origins = np.broadcast_to(poses[:, None, :3, 3], directions.shape)
        distance, normals = self._cast(origins, directions)
        return np.where(distance < 400, distance, np.nan), -(normals * directions).sum(axis=-1)

    def _camera_sees(self, poses: FloatArray, hit: FloatArray, seen: np.ndarray) -> np.ndarray:
        """Return whether nothing stands between the points (P, C, 3) in L and the camera."""
        camera = np.array([0.0, self.options.baseline_mm, 0.0])
        toward = camera - np.where(seen[..., None], hit, 0.0)
        length = np.sqrt((toward**2).sum(axis=-1, keepdims=True))
        toward /= length
        start = np.where(seen[..., None], hit, 0.0) + 0.02 * toward  # off the surface itself
        rotation = poses[:, :3, :3]
        origins = np.einsum("pij,pcj->pci", rotation, start) + poses[:, None, :3, 3]
        distance, _ = self._cast(origins, np.einsum("pij,pcj->pci", rotation, toward))
        return distance > length[..., 0] - 0.1

    def _mix(self, measured: FloatArray, cosine: FloatArray, rng: np.random.Generator) -> np.ndarray:
        """Put the last point before a jump between both sides, in places; return which.

        A surface that is seen at a grazing angle steps farther from point to point, but does not jump.
        """
        jump = np.zeros(measured.shape, dtype=bool)
        steepest = np.clip(np.minimum(cosine[:, :-1], cosine[:, 1:]), 0.05, 1.0)
        sloped = self.options.pitch_mm * np.abs(measured[:, :-1]) / 200.0 * np.sqrt(1 / steepest**2 - 1)
        jump[:, :-1] = np.abs(np.diff(measured, axis=1)) > 3.0 + 1.5 * sloped
        mixed = jump & (rng.random(measured.shape) < self.options.mixed_fraction)
        share = rng.uniform(0.25, 0.75, measured.shape)
        beyond = np.roll(measured, -1, axis=1)
        measured[mixed] += (share * (beyond - measured))[mixed]
        return mixed


def view_poses(count: int, distance_mm: float = 200.0, aim_mm: float = 25.0) -> list[FloatArray]:
    """Return turntable_from_laser of views from all around, in turn at 20°, 45° and 75° above the table."""
    poses: list[FloatArray] = []
    for k in range(count):
        around, up = 2 * np.pi * k / count, np.deg2rad((20.0, 45.0, 75.0)[k % 3])
        out = np.array([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.sin(up)])
        x = np.array([-np.sin(around), np.cos(around), 0.0])
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([x, np.cross(-out, x), -out])
        pose[:3, 3] = (0.0, 0.0, aim_mm) + distance_mm * out
        poses.append(pose)
    return poses
