"""The paper's way to the turntable: a circle at each height, and the axis through the circles' centres.

Li et al., Optik (2010), the third calibration.  With one height only, the axis is the normal of its circle.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray
from calib_core.sphere.circle import fit_circle

_LEAST_CAPTURES = 3
_LEAST_DISTANCE_MM = 20.0


@dataclass(frozen=True, eq=False)
class TableCircle:
    """A circle in space.

    Attributes
    ----------
    mount : int
    center, normal : (3,), (3,)
        In base; the normal's sense is arbitrary.
    radius_mm, circle_rms_mm, plane_rms_mm : float
        And how far the centres are from it: across in the plane, and out of the plane.
    captures : (N,) int
    """

    mount: int
    center: FloatArray
    normal: FloatArray
    radius_mm: float
    circle_rms_mm: float
    plane_rms_mm: float
    captures: np.ndarray


@dataclass(frozen=True, eq=False)
class PaperAxis:
    """The axis (direction, point in base) of the paper's way, or none; and its circles."""

    circles: list[TableCircle]
    direction: FloatArray | None
    point: FloatArray | None


def paper_axis(centers: FloatArray, mounts: np.ndarray, used: np.ndarray) -> PaperAxis:
    """Return a circle for each mounting and the axis through them.

    Parameters
    ----------
    centers : (K, 3)
        The captures' own sphere centres in base, mm, sides decided.
    mounts : (K,) int
    used : (K,) bool
    """
    circles: list[TableCircle] = []
    for mount in sorted({int(m) for m in mounts}):
        members = np.flatnonzero((mounts == mount) & used)
        if len(members) >= _LEAST_CAPTURES:
            circles.append(_circle(centers[members], mount, members))
    if not circles:
        return PaperAxis([], None, None)
    direction = _direction(circles)
    return PaperAxis(circles, direction, circles[0].center)


def _circle(centers: FloatArray, mount: int, members: np.ndarray) -> TableCircle:
    middle = centers.mean(axis=0)
    _, _, axes = np.linalg.svd(centers - middle)
    local = (centers - middle) @ axes.T
    flat = local[:, :2]
    # x² + y² = 2 x a + 2 y b + c: linear, and near enough to start from.
    rows = np.column_stack([2 * flat, np.ones(len(flat))])
    a, b, c = np.linalg.lstsq(rows, (flat**2).sum(axis=1), rcond=None)[0]
    fit = fit_circle(flat, np.array([a, b, np.sqrt(max(c + a * a + b * b, 1e-12))]))
    x, y, radius = fit.parameters
    return TableCircle(
        mount=mount,
        center=middle + x * axes[0] + y * axes[1],
        normal=axes[2],
        radius_mm=float(radius),
        circle_rms_mm=float(np.sqrt(np.mean(fit.residuals**2))),
        plane_rms_mm=float(np.sqrt(np.mean(local[:, 2] ** 2))),
        captures=members,
    )


def _direction(circles: Sequence[TableCircle]) -> FloatArray:
    """Return the axis from the first circle's centre to the farthest; the first's normal where all are near."""
    first = circles[0]
    shifts = np.array([circle.center - first.center for circle in circles])
    lengths = np.linalg.norm(shifts, axis=1)
    farthest = int(np.argmax(lengths))
    if lengths[farthest] < _LEAST_DISTANCE_MM:
        return first.normal
    return shifts[farthest] / lengths[farthest]
