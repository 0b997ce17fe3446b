"""An arc that was found in a profile: its circle and inliers, and what tells a real arc from a chance one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.sphere.circle import BoolArray, distances_to_circle, fit_circle, median_of, sigma_of_kept

LONG_RAD = float(np.deg2rad(30.0))
_LARGEST_RMS = 0.03  # of the radius: rougher than this it is not an arc
_MOST_BACKGROUND = 0.1  # share of the inliers that chance would put there
_EDGE_RAD = np.deg2rad(1.5)  # the border of an arc holds mixed points: half on the sphere, half behind it
_EDGE_SHARE = 0.05
_WIDEST_GAP_RAD = np.deg2rad(4.0)
_FORM_BINS = 12
_LARGEST_FORM = 0.0075  # of the radius: bent otherwise than a circle, as walls and edges are
_LEAST_FILLED = 0.5  # of the extent: the two walls of a corner touch a circle too, but not in between
_MOST_ALIKE = 0.95  # of neighbours: beyond it an arc says nothing of itself
_BEYOND_DOUBT_EXTENT_RAD = np.deg2rad(75.0)
_BEYOND_DOUBT_RMS = 0.015  # of the radius
_SMALL_PIECE = 0.05  # of the inliers: pieces beyond a gap that are smaller than this are left out
LEAST_TOLD = 0.01
"""A share of the radius: a narrower arc is used where it tells its radius so well, correlation counted."""

LEAST_POINTS = 12


def points_per_independent(lag1_correlation: float) -> float:
    """Return how many points say as much as one that errs by itself, neighbours correlated so."""
    correlation = min(max(lag1_correlation, 0.0), _MOST_ALIKE)
    return (1 + correlation) / (1 - correlation)


@dataclass(frozen=True, eq=False)
class FoundArc:
    """One arc that was found: its circle, inliers and what tells a real arc from a chance one."""

    circle: FloatArray
    normal_matrix: FloatArray
    inliers: BoolArray
    sigma_mm: float
    rms_mm: float
    extent_rad: float
    side: int
    form_mm: float  # root mean square of the residuals' means over stretches of the arc
    filled: float  # share of the extent that is not gaps
    background: float  # inliers to be expected from the density of points beside the arc
    lag1: float  # correlation of neighbours' residuals

    @property
    def count(self) -> int:
        """How many points it has."""
        return int(self.inliers.sum())

    @property
    def is_clear(self) -> bool:
        """Whether the points are an arc at all: enough, smooth, bent, and denser than what lies beside."""
        depth_mm = self.circle[2] * (1 - np.cos(self.extent_rad / 2))
        return (
            self.count >= LEAST_POINTS
            and self.rms_mm <= _LARGEST_RMS * self.circle[2]
            and self.filled >= _LEAST_FILLED
            and self.form_mm**2
            <= (_LARGEST_FORM * self.circle[2]) ** 2 + 4 * self.rms_mm**2 * _FORM_BINS / self.count
            and depth_mm > 6 * self.rms_mm
            and self.background <= _MOST_BACKGROUND * self.count
        )

    @property
    def is_long(self) -> bool:
        """Whether its angle alone makes its circle known."""
        return self.extent_rad >= LONG_RAD

    @property
    def told(self) -> float:
        """The standard deviation of its radius as a share of it."""
        return self.sigma_radius_mm * float(np.sqrt(points_per_independent(self.lag1))) / float(self.circle[2])

    @property
    def tells_enough(self) -> bool:
        """Whether its circle is known: by a wide angle, or by many good points of a narrower one."""
        return self.is_long or self.told <= LEAST_TOLD

    @property
    def is_beyond_doubt(self) -> bool:
        """Whether no background can look like this: smooth over a wide angle."""
        return self.extent_rad >= _BEYOND_DOUBT_EXTENT_RAD and self.rms_mm < _BEYOND_DOUBT_RMS * self.circle[2]

    @property
    def sigma_radius_mm(self) -> float:
        """Standard deviation of its radius, points taken as independent."""
        return self.sigma_mm * float(np.sqrt(np.linalg.inv(self.normal_matrix)[2, 2]))

    @property
    def sharpness(self) -> float:
        """How well the circle is determined: its radius in standard deviations of the radius."""
        return float(self.circle[2]) / max(self.sigma_radius_mm, 1e-9 * float(self.circle[2]))


def finished_arc(points: FloatArray, circle: FloatArray, kept: BoolArray, cut: float) -> FoundArc | None:
    """Return the arc of the points that a circle keeps, its border left out; None where too few are left."""
    kept = _without_edges(points, circle, kept)
    if kept.sum() < LEAST_POINTS // 2:
        return None
    fit = fit_circle(points[kept], circle)
    if not fit.parameters[2] > 0:
        return None
    sigma = sigma_of_kept(fit.residuals, 3)
    angle, toward = _angles(points, fit.parameters, kept)
    low, high = float(angle[kept].min()), float(angle[kept].max())
    misfit = np.abs(distances_to_circle(points, fit.parameters))
    beside = (misfit > 1.2 * cut) & (misfit < 3.2 * cut) & (angle > low) & (angle < high)
    return FoundArc(
        circle=fit.parameters,
        normal_matrix=fit.normal_matrix,
        inliers=kept,
        sigma_mm=sigma,
        rms_mm=float(np.sqrt(np.mean(fit.residuals**2))),
        extent_rad=high - low,
        side=1 if toward[1] < 0 else -1,
        form_mm=_form(angle[kept], fit.residuals),
        filled=1 - _gaps(np.sort(angle[kept]))[1] / max(high - low, 1e-300),
        background=float(beside.sum()) / 2,
        lag1=_lag1_correlation(points[kept], fit.parameters),
    )


def _angles(points: FloatArray, circle: FloatArray, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return every point's angle (N,) about the centre from the arc's middle, and the middle's direction (2,)."""
    offset = points - circle[:2]
    unit = offset[kept] / np.maximum(np.hypot(offset[kept, 0], offset[kept, 1]), 1e-300)[:, None]
    middle = unit.mean(axis=0)
    middle = middle / max(float(np.hypot(*middle)), 1e-300)
    along, across = offset @ middle, offset @ np.array([-middle[1], middle[0]])
    return np.arctan2(across, along), middle


def _without_edges(points: FloatArray, circle: FloatArray, kept: BoolArray) -> BoolArray:
    """Leave out the border of the arc and small pieces of it beyond gaps."""
    rows = np.flatnonzero(kept)
    angle = _angles(points, circle, kept)[0][rows]
    rows, angle = rows[np.argsort(angle, kind="stable")], np.sort(angle)
    ends = _gaps(angle)[0]
    result = np.zeros(len(points), dtype=bool)
    for first, last in zip([0, *ends.tolist()], [*ends.tolist(), len(rows)], strict=True):
        count = last - first
        if count < max(3, _SMALL_PIECE * len(rows)):
            continue
        most = int(_EDGE_SHARE * count)
        piece = angle[first:last]
        low = min(int(np.searchsorted(piece, piece[0] + _EDGE_RAD)), most)
        high = min(count - int(np.searchsorted(piece, piece[-1] - _EDGE_RAD)), most)
        result[rows[first + low : last - high]] = True
    return result


def _form(angle_rad: FloatArray, residuals: FloatArray) -> float:
    """Return how far stretches of the arc lie from the circle, noise averaged out: RMS of their mean residuals."""
    stretch = np.floor(
        (angle_rad - angle_rad.min()) / max(np.ptp(angle_rad), 1e-300) * (_FORM_BINS - 1e-6)
    ).astype(int)
    count = np.bincount(stretch, minlength=_FORM_BINS)
    mean = np.bincount(stretch, residuals, minlength=_FORM_BINS) / np.maximum(count, 1)
    return float(np.sqrt(count @ mean**2 / len(residuals)))


def _gaps(sorted_angle_rad: FloatArray) -> tuple[NDArray[np.intp], float]:
    """Return where the gaps of an arc end, as indices into its sorted angles, and their angles' sum."""
    steps = np.diff(sorted_angle_rad)
    wide = steps > max(_WIDEST_GAP_RAD, 8 * median_of(steps))
    return np.flatnonzero(wide) + 1, float(steps[wide].sum())


def _lag1_correlation(points: FloatArray, circle: FloatArray) -> float:
    residuals = distances_to_circle(points, circle)
    residuals = residuals - residuals.mean()
    power = float(residuals @ residuals)
    return float(residuals[1:] @ residuals[:-1]) / power if power > 0 else 0.0
