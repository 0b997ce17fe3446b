"""One scan: its points on the grid of profiles and columns it was taken in, and where each profile stood in T."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.frames import FloatArray, finite_rows
from calib_core.messages import message

SingleArray = NDArray[np.float32]

_ROW = 1024  # a cloud without a grid is worked on in rows of this length
_LOOKED_AT = 300  # lines each way, of which the spacing is found
_AROUND, _MIDDLE, _ASKED = 6, 20_000, 1000  # points around one, of those in the middle, of which so many are asked


@dataclass(frozen=True, eq=False)
class Scan:
    """Points of one scan in L, and their way into T.

    Parameters
    ----------
    name : str
    points_in_laser_mm : (P, C, 3) float32
        Row by row the profiles (or the rows of an area scanner's image); NaN where nothing came back.
    turntable_from_laser : (P, 4, 4) or (1, 4, 4)
        A pose each profile, or one for the whole scan.
    point_sigma_mm : float
        Standard deviation of a point's distance to the surface, seen head-on.
    position_sigma_mm : float
        Standard deviation of the whole scan's place: what the chain leaves uncertain.
    organised : bool
        Whether rows and columns are neighbours on the object; a plain cloud's are not, and it cannot be cleaned on
        its grid.
    looks_along_z : {1, -1, None}
        +1 where z grows away from the scanner, −1 where it grows toward it; None where the scans are to say.
    intensity : (P, C) float32 or None
        How bright each point came back, in the file's own unit.
    """

    name: str
    points_in_laser_mm: SingleArray
    turntable_from_laser: FloatArray
    point_sigma_mm: float = 0.02
    position_sigma_mm: float = 0.0
    organised: bool = True
    looks_along_z: int | None = None
    intensity: SingleArray | None = None

    def __post_init__(self) -> None:
        points, poses = self.points_in_laser_mm, self.turntable_from_laser
        if points.ndim != 3 or points.shape[2] != 3 or points.size == 0:
            raise InputError(
                "a scan of profiles × columns × 3 numbers",
                "a scan with no points"
                if points.size == 0
                else message("an array of shape {shape}", shape=points.shape),
                "Take the scan again, or exclude it.",
                self.name,
            )
        if poses.shape not in ((len(points), 4, 4), (1, 4, 4)):
            need = "one pose for the scan or one for each of its {count} profiles"
            to_do = "Give as many poses as profiles: a profile or a pose is missing."
            raise InputError(
                need, "{count_other} poses", to_do, self.name, count=len(points), count_other=len(poses)
            )
        if not np.isfinite(poses).all():
            raise InputError("finite poses", "NaN or infinity", "Check where the poses come from.", self.name)
        if not (np.isfinite(self.point_sigma_mm) and self.point_sigma_mm > 0):
            to_do = "State the scanner's noise in mm."
            raise InputError("a positive point_sigma_mm", f"{self.point_sigma_mm}", to_do, self.name)
        if not finite_rows(points).any():
            got = "{count} blanks: nothing came back to the scanner"
            to_do = "Take the scan again, or exclude it."
            raise InputError("a scan with points", got, to_do, self.name, count=points.shape[0] * points.shape[1])

    @property
    def spacing_mm(self) -> float:
        """How far its points lie apart: the farther one of rows and columns; 0 where too few are known to say."""
        points, poses = self.points_in_laser_mm, self.turntable_from_laser
        if self.organised:
            rows, columns = (slice(None, None, 1 + many // _LOOKED_AT) for many in points.shape[:2])
            lines = (points[:, columns], poses), (points[rows], poses[rows] if len(poses) > 1 else poses)
            steps = [
                np.linalg.norm(np.diff(_in_turntable(*line), axis=axis), axis=2) for axis, line in enumerate(lines)
            ]
            known = [one[np.isfinite(one)] for one in steps]
            return max((float(np.median(one)) for one in known if len(one)), default=0.0)
        return _spacing_of_cloud(points[finite_rows(points)].astype(float))

    @property
    def sight(self) -> FloatArray:
        """Unit direction of sight in T, (P, 3) or (1, 3): the z axis of L, until the scans say otherwise."""
        return (self.looks_along_z or 1) * self.turntable_from_laser[:, :3, 2]


def _in_turntable(points: SingleArray, poses: FloatArray) -> FloatArray:
    return np.einsum("pij,pcj->pci", poses[:, :3, :3], points) + poses[:, None, :3, 3]


def _spacing_of_cloud(points_mm: FloatArray) -> float:
    """Return how far points (N, 3) of a surface lie apart, by how many lie around some in their middle."""
    from scipy.spatial import KDTree

    if len(points_mm) <= _AROUND:
        return 0.0
    off = ((points_mm - np.median(points_mm, axis=0)) ** 2).sum(axis=1)
    near = points_mm[np.argpartition(off, _MIDDLE)[:_MIDDLE]] if len(off) > _MIDDLE else points_mm
    reach, _ = KDTree(near).query(near[:: 1 + len(near) // _ASKED], k=_AROUND + 1)
    return float(np.median(reach[:, -1])) * float(np.sqrt(np.pi / _AROUND))


def as_rows(points: SingleArray) -> SingleArray:
    """Return points (N, K) as rows (P, C, K), the last filled up with NaN."""
    columns, width = min(_ROW, max(len(points), 1)), points.shape[1]
    missing = -len(points) % columns
    if missing:
        points = np.concatenate([points, np.full((missing, width), np.nan, np.float32)])
    return np.ascontiguousarray(points).reshape(-1, columns, width)
