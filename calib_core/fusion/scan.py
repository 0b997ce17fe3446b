"""One scan: its points on the grid of profiles and columns it was taken in, and where each profile stood in T."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.messages import message

SingleArray = NDArray[np.float32]

_ROW = 1024  # a cloud without a grid is worked on in rows of this length


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
    """

    name: str
    points_in_laser_mm: SingleArray
    turntable_from_laser: FloatArray
    point_sigma_mm: float = 0.02
    position_sigma_mm: float = 0.0
    organised: bool = True
    looks_along_z: int | None = None

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
            raise InputError(
                "one pose for the scan or one for each of its {count} profiles",
                "{count_other} poses",
                "Give as many poses as profiles: a profile or a pose is missing.",
                self.name,
                count=len(points),
                count_other=len(poses),
            )
        if not np.isfinite(poses).all():
            raise InputError("finite poses", "NaN or infinity", "Check where the poses come from.", self.name)
        if not (np.isfinite(self.point_sigma_mm) and self.point_sigma_mm > 0):
            raise InputError(
                "a positive point_sigma_mm",
                f"{self.point_sigma_mm}",
                "State the scanner's noise in mm.",
                self.name,
            )
        if not np.isfinite(points).all(axis=2).any():
            raise InputError(
                "a scan with points",
                "{count} blanks: nothing came back to the scanner",
                "Take the scan again, or exclude it.",
                self.name,
                count=points.shape[0] * points.shape[1],
            )

    @property
    def sight(self) -> FloatArray:
        """Unit direction of sight in T, (P, 3) or (1, 3): the z axis of L, until the scans say otherwise."""
        return (self.looks_along_z or 1) * self.turntable_from_laser[:, :3, 2]


def as_rows(points: SingleArray) -> SingleArray:
    """Return points (N, 3) as rows (P, C, 3), the last filled up with NaN."""
    columns = min(_ROW, max(len(points), 1))
    missing = -len(points) % columns
    if missing:
        points = np.concatenate([points, np.full((missing, 3), np.nan, np.float32)])
    return np.ascontiguousarray(points).reshape(-1, columns, 3)
