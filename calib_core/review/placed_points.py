"""Where two results of a stage put one point of the workpiece, to be drawn beside each other."""

from dataclasses import dataclass

from calib_core.exports.workpiece import point_jacobian
from calib_core.frames import FloatArray, RigidTransform
from calib_core.review.compare import Compared, shared_frames


@dataclass(frozen=True, eq=False)
class PlacedPoint:
    """One point of the workpiece as two results place it, in the frame that both are given in.

    Attributes
    ----------
    frame : str
        The field of the results, That of the scanner or another.
    poses : tuple of RigidTransform
        The frame by the first result, and by the second.
    point_mm : (3,)
        The point in the inner frame.
    covariances : tuple of (3, 3)
        How well either knows the point's place, mm².
    """

    frame: str
    poses: tuple[RigidTransform, RigidTransform]
    point_mm: FloatArray
    covariances: tuple[FloatArray, FloatArray]


def placed_points(left: Compared, right: Compared) -> list[PlacedPoint]:
    """Return where two results of a stage put one point of the workpiece: one entry for each frame they give."""
    placed: list[PlacedPoint] = []
    for name, poses, known, point in shared_frames(left, right):
        jacobians = [point_jacobian(pose, point) for pose in poses]
        first, second = (j @ k @ j.T for j, k in zip(jacobians, known, strict=True))
        placed.append(PlacedPoint(name, poses, point, (first, second)))
    return placed
