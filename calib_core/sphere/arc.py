"""The arc of the sphere in one profile, on an arbitrary background: circle, covariance, inliers, visible side."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import plural
from calib_core.sphere.arc_candidates import arc_candidates
from calib_core.sphere.circle import CUT_IN_SIGMAS as CUT
from calib_core.sphere.circle import BoolArray, circle_step, distances_to_circle, median_of
from calib_core.sphere.diagnosis import SMALLEST_CIRCLE, points_as_rows, radius_mismatch, require_diameter
from calib_core.sphere.found_arc import (
    LEAST_POINTS,
    LEAST_TOLD,
    LONG_RAD,
    FoundArc,
    finished_arc,
    points_per_independent,
)

_STEEPEST_COS = float(np.cos(np.deg2rad(75.0)))

_START_BAND = 0.03  # of the radius: where a refinement starts to collect points
_NEAR_LARGEST = 1.1  # times the sphere's radius: larger candidates do not refine to one of its circles


@dataclass(frozen=True, eq=False)
class ArcFit:
    """A circle in the plane of light, as the arc of a sphere shows it, in L.

    Attributes
    ----------
    center_mm : (2,)
        x and z of the circle's centre.
    radius_mm : float
        The circle's radius; the sphere's is at least that.
    covariance : (3, 3)
        Of x, z and radius, mm², for independent point errors of `point_sigma_mm`.
    rms_mm : float
        Root mean square of the inliers' distances to the circle.
    point_sigma_mm : float
        Standard deviation of one point across the arc, estimated from the inliers.
    inliers : (N,) bool
        The points of the profile that lie on the arc.
    extent_rad : float
        Angular length of the arc, from its first to its last inlier.
    visible_side : int
        +1 where the arc bulges to −z (z grows away from the scanner), −1 where it bulges to +z (`toward`).
    lag1_correlation : float
        Correlation of the residuals of neighbours along the arc.  Near 0 the points err independently and the
        covariance is true; sensors that smooth along the stripe come to 0.8, and the true covariance is then about
        (1 + c) / (1 − c) times the stated one.
    """

    center_mm: FloatArray
    radius_mm: float
    covariance: FloatArray
    rms_mm: float
    point_sigma_mm: float
    inliers: NDArray[np.bool_]
    extent_rad: float
    visible_side: int
    lag1_correlation: float

    @property
    def points_per_independent(self) -> float:
        """How many of its points say as much as one that errs by itself, as far as neighbours tell."""
        return points_per_independent(self.lag1_correlation)

    def apart_mm(self, other: "ArcFit") -> float:
        """Return how far another is from it: their centres or their radii."""
        centers_mm = np.linalg.norm(other.center_mm - self.center_mm)
        return float(max(centers_mm, abs(other.radius_mm - self.radius_mm)))


def fit_arc(
    points_in_laser_mm: ArrayLike,
    sphere_diameter_mm: float | None,
    z_axis: Literal["away", "toward"] | None = None,
) -> ArcFit:
    """Find the arc that a sphere leaves in a profile and fit its circle by least squares of geometric distance.

    Candidate circles come from windows of the profile (`arc_candidates`); each is refined on the points near it,
    with a cut that follows their spread.  Of those that are long, bent, dense and possible for the sphere, the one
    determined best is taken.  The arc's border and small pieces beyond gaps are left out.  Covariance: σ² (JᵀJ)⁻¹
    of the distance's derivative (−u, −1).

    Parameters
    ----------
    points_in_laser_mm : (N, 2)
        x and z in L.  Rows with NaN are blanks.  In the order of the stripe, or in none; repeated rows count once.
    sphere_diameter_mm : float or None
        The sphere's diameter; None accepts a circle of any radius.
    z_axis : "away", "toward" or None
        Which way z grows, seen from the scanner; None lets the data decide.

    Raises
    ------
    MeasurementError
        If there are too few points, no arc, only a short one or one on the hidden side, or if its radius
        contradicts the diameter (the likely reason is named).
    """
    given = points_as_rows(points_in_laser_mm, 2, "profile")
    require_diameter(sphere_diameter_mm)
    points, row_of_point = _distinct_finite(given)
    arcs = _arcs_in(points, sphere_diameter_mm, z_axis)
    if sphere_diameter_mm is not None and not any(_is_possible(one, sphere_diameter_mm, z_axis) for one in arcs):
        # Of several balls side by side all points lie near large circles, more than near any ball's own.
        arcs += _arcs_in(points, sphere_diameter_mm, z_axis, _NEAR_LARGEST * sphere_diameter_mm / 2)
    arc = _the_one(arcs, sphere_diameter_mm, z_axis)
    inliers = np.zeros(len(given), dtype=bool)
    inliers[row_of_point >= 0] = arc.inliers[row_of_point[row_of_point >= 0]]
    return ArcFit(
        center_mm=arc.circle[:2].copy(),
        radius_mm=float(arc.circle[2]),
        covariance=np.asarray(arc.sigma_mm**2 * np.linalg.inv(arc.normal_matrix), dtype=float),
        rms_mm=arc.rms_mm,
        point_sigma_mm=arc.sigma_mm,
        inliers=inliers,
        extent_rad=arc.extent_rad,
        visible_side=arc.side,
        lag1_correlation=arc.lag1,
    )


def _distinct_finite(given: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the distinct finite points in their order, and each given row's point (−1 for blanks)."""
    if np.isinf(given).any():
        need = "finite numbers, or NaN where nothing came back"
        to_do = "Write blanks or NaN where the scanner saw nothing."
        raise MeasurementError(
            need, "infinity in row {given}", to_do, given=int(np.isinf(given).any(axis=1).argmax()) + 1
        )
    rows = np.flatnonzero(np.isfinite(given).all(axis=1))
    if len(rows) == 0:
        got = plural("{count} row, all blank", "{count} rows, all blank", by="count", count=len(given))
        to_do = "Bring the sphere into the scanner's range and check the exposure."
        raise MeasurementError("a profile with points", got, to_do)
    keys = given[rows, 0] + 1j * given[rows, 1]  # sorts faster than rows do
    _, first, member = np.unique(keys, return_index=True, return_inverse=True)
    by_first = np.argsort(first)
    rank = np.empty(len(first), dtype=np.intp)
    rank[by_first] = np.arange(len(first))
    row_of_point = np.full(len(given), -1, dtype=np.intp)
    row_of_point[rows] = rank[member]
    points = given[rows[first[by_first]]]
    if len(points) < LEAST_POINTS:
        raise MeasurementError(
            "at least {least_points} points on the sphere",
            plural(
                "{count} point in the whole profile",
                "{count} points in the whole profile",
                by="count",
                count=len(points),
            ),
            "Bring the sphere into the scanner's range and check the exposure.",
            least_points=LEAST_POINTS,
        )
    return points, row_of_point


def _arcs_in(
    points: FloatArray, diameter_mm: float | None, z_axis: str | None, largest_mm: float = np.inf
) -> list[FoundArc]:
    """Return the refined candidates; the search ends early once no other candidate can beat a good one."""
    arcs: list[FoundArc] = []
    best = 0
    circles, support = arc_candidates(points, largest_mm)
    for circle, most in zip(circles, support, strict=True):
        if best > 1.3 * most:
            break
        arc = _refined(points, circle)
        if arc is not None:
            arcs.append(arc)
            if arc.is_beyond_doubt and _is_possible(arc, diameter_mm, z_axis):
                best = max(best, arc.count)
    return arcs


def _refined(points: FloatArray, circle: FloatArray) -> FoundArc | None:
    """Follow a candidate to the circle that its own points define, or return None where it dissolves."""
    start_radius = circle[2]
    cut = widest = _START_BAND * start_radius
    kept = np.zeros(len(points), dtype=bool)
    for _ in range(25):
        misfit = np.abs(distances_to_circle(points, circle))
        before, kept = kept, _on_one_side(points, circle, misfit < cut)
        if kept.sum() < LEAST_POINTS // 2:
            return None
        if np.array_equal(before, kept):
            break
        circle = circle_step(points[kept], circle).parameters
        if not (start_radius / 5 < circle[2] < start_radius * 5):
            return None
        sigma = 1.4826 * median_of(misfit[kept])
        cut = min(widest, max(CUT * sigma, 1e-7 * circle[2]))
    return finished_arc(points, circle, kept, cut)


def _on_one_side(points: FloatArray, circle: FloatArray, kept: BoolArray) -> BoolArray:
    """Keep what lies within 90° of the arc's middle: a scanner sees at most half of a circle."""
    if not kept.any():
        return kept
    offset = points - circle[:2]
    return kept & (offset @ offset[kept].mean(axis=0) > 0)


def _is_possible(arc: FoundArc, diameter_mm: float | None, z_axis: str | None) -> bool:
    return arc.is_clear and arc.tells_enough and _radius_fits(arc, diameter_mm) and _side_fits(arc, z_axis)


def _radius_fits(arc: FoundArc, diameter_mm: float | None) -> bool:
    """Whether the circle can be cut from the sphere: no larger than it, within the noise and half a per cent."""
    if diameter_mm is None:
        return True
    largest_mm = diameter_mm / 2 + max(5 * arc.sigma_radius_mm, 0.005 * diameter_mm / 2)
    return SMALLEST_CIRCLE * diameter_mm / 2 <= arc.circle[2] <= largest_mm


def _side_fits(arc: FoundArc, z_axis: str | None) -> bool:
    return z_axis is None or arc.side == (1 if z_axis == "away" else -1)


def _the_one(arcs: list[FoundArc], diameter_mm: float | None, z_axis: str | None) -> FoundArc:
    """Return the possible arc that is determined best, or raise the error that says why there is none."""
    possible = [arc for arc in arcs if _is_possible(arc, diameter_mm, z_axis)]
    if possible:
        return max(possible, key=lambda arc: (arc.is_long, arc.sharpness))
    clear = [arc for arc in arcs if arc.is_clear]
    if not clear:
        to_do = "Aim the stripe at the sphere, off its edge, and see that nothing hides it."
        raise MeasurementError("the arc of a sphere in the profile", "none: nothing in it is round enough", to_do)
    best = max(clear, key=lambda arc: (arc.is_long, arc.sharpness))
    if not best.tells_enough:
        raise MeasurementError(
            "an arc of {long_deg:.0f}°, or one that tells its radius to {least_percent:g} %",
            "one of {extent_deg:.1f}° that tells it to {percent:.1f} %",
            "Move so that the stripe crosses more of the sphere and all of the visible side lies in range.",
            long_deg=np.rad2deg(LONG_RAD),
            least_percent=100 * LEAST_TOLD,
            extent_deg=np.rad2deg(best.extent_rad),
            percent=100 * best.told,
        )
    if not _side_fits(best, z_axis):
        other = "toward" if z_axis == "away" else "away"
        raise MeasurementError(
            "an arc on the side that the scanner sees (z_axis: {z_axis})",
            "one that bulges to {far_side}, the far side",
            "Set the scanner's z_axis to {other}, or leave it out.",
            z_axis=z_axis,
            far_side="−z" if best.side > 0 else "+z",
            other=other,
        )
    assert diameter_mm is not None  # the radius is all that is left to be wrong
    raise radius_mismatch(float(best.circle[2]), diameter_mm, "arc")


def without_rim(points_mm: FloatArray, arc: ArcFit, sphere_radius_mm: float, eye_mm: FloatArray) -> ArcFit:
    """Return an arc fitted without the points that are seen too steeply; the same where too few would be left.

    Parameters
    ----------
    points_mm : (N, 2)
        The profile, x and z in L.
    arc : ArcFit
        Its arc. On which side of the light the sphere's middle lies is not known: either counts.
    sphere_radius_mm : float
    eye_mm : (3,)
        The camera's centre in L.
    """
    points = np.insert(points_mm, 1, 0.0, axis=1)
    rays = eye_mm - points
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    height_mm = float(np.sqrt(max(sphere_radius_mm**2 - arc.radius_mm**2, 0.0)))
    x, z = arc.center_mm
    cosines = [np.sum((points - [x, side * height_mm, z]) * rays, axis=1) / sphere_radius_mm for side in (-1, 1)]
    steep = arc.inliers & (np.min(cosines, axis=0) < _STEEPEST_COS)
    if not steep.any():
        return arc
    left = np.where(steep[:, None], np.nan, points_mm)
    try:
        fitted = fit_arc(left, 2 * sphere_radius_mm, "away" if arc.visible_side > 0 else "toward")
    except MeasurementError:
        return arc
    return replace(fitted, extent_rad=arc.extent_rad)
