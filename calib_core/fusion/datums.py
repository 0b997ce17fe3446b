"""Where the nominal part lies by datum features: places that it touches (3-2-1), planes and spheres.

Each feature is measured among the points near it, and says how far they lie off the nominal's own at some places
along some directions: three rows for a plane (at three places of its rim) and for a sphere (its centre), one for a
touch.  The nominal is laid where these are least, all rows alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import CalibrationError, MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.alignment import Alignment, about_origin, facing_alike, rows_of, stepped
from calib_core.fusion.deviation import Nominal
from calib_core.messages import message
from calib_core.sphere.cloud import LEAST_POINTS, fit_sphere

_ROUNDS = 10
_LEAST_MM = 1e-4
_OPEN = 1e-4  # of the best held direction: held less than this is open
_NEAR, _NEAR_RMS = 0.1, 10.0  # of a feature's radius, and of the best fit's RMS: its points lie so near
_CUT, _CUTS = 3.0, 10  # robust sigmas off a plane that its points lie within
_OTHER_SIZE = 0.1  # of a sphere's radius
_FEWEST_PATCHES = 8


@dataclass(frozen=True, eq=False)
class Feature:
    """A datum feature of the nominal, in its own frame.

    Parameters
    ----------
    kind : {"point", "plane", "sphere"}
    at_mm : (3,)
        On the surface; a sphere's centre.
    radius_mm : float
        Of a sphere; how far a plane or a touch reaches about its place.
    normal : (3,)
        Outward; of no meaning for a sphere.
    """

    kind: Literal["point", "plane", "sphere"]
    at_mm: FloatArray
    radius_mm: float
    normal: FloatArray

    def _rim(self) -> FloatArray:
        """Return three places of a plane, from its middle, evenly about it."""
        across = np.linalg.svd(self.normal[None])[2][1:]
        turns = 2 * np.pi * np.arange(3) / 3
        return self.radius_mm / 2 * (np.cos(turns)[:, None] * across[0] + np.sin(turns)[:, None] * across[1])

    def places(self) -> tuple[FloatArray, FloatArray]:
        """Return the places (K, 3) and the directions (K, 3) that its rows are told at and along."""
        if self.kind == "point":
            return self.at_mm[None], self.normal[None]
        if self.kind == "plane":
            return self.at_mm + self._rim(), np.tile(self.normal, (3, 1))
        return np.tile(self.at_mm, (3, 1)), np.eye(3)

    def off(self, points_mm: FloatArray) -> FloatArray:
        """Return how far points (N, 3) of the nominal's frame lie off its surface."""
        apart = points_mm - self.at_mm
        return np.linalg.norm(apart, axis=1) - self.radius_mm if self.kind == "sphere" else apart @ self.normal

    def near(self, points_mm: FloatArray, normals: FloatArray, reach_mm: float) -> NDArray[np.bool_]:
        """Return which of the points are of it, `reach_mm` off its surface at most."""
        off = self.off(points_mm)
        near = np.abs(off) < reach_mm
        if self.kind == "sphere":
            return near
        beside = np.linalg.norm(points_mm - self.at_mm - off[:, None] * self.normal, axis=1)
        return near & (beside < self.radius_mm) & facing_alike(normals @ self.normal)

    def design(self, points_mm: FloatArray, normals: FloatArray) -> FloatArray:
        """Return how distances at points follow from its rows (N, 3 or 1); a sphere's radius is the last."""
        if self.kind == "point":
            return np.ones((len(points_mm), 1))
        if self.kind == "sphere":
            return np.concatenate([normals, np.ones((len(normals), 1))], axis=1)
        rim = self._rim()  # barycentric coordinates in an even triangle
        return 1 / 3 + 2 / 3 * (points_mm - self.at_mm) @ (rim / (rim**2).sum(axis=1)[:, None]).T


@dataclass(frozen=True, eq=False)
class Measured:
    """A feature as the points have it: its rows' values (K,) with covariance, and what it goes by.

    `distances_mm` are those of its points from the nominal's own, `rms_mm` what they are off the fitted one.
    """

    values_mm: FloatArray
    covariance: FloatArray
    distances_mm: FloatArray
    rms_mm: float
    radius_mm: float
    spatial: bool = False

    @property
    def off_mm(self) -> float:
        """How far it lies off the nominal's: its centre, or a plane where it is farthest."""
        values = np.abs(self.values_mm)
        return float(np.linalg.norm(values) if self.spatial else values.max())


@dataclass(frozen=True, eq=False)
class DatumAlignment(Alignment):
    """Where the nominal lies by features of its own: these, and each as the points have it."""

    datums: tuple[Feature, ...] = ()
    measured: tuple[Measured, ...] = ()


def on_nominal(
    nominal: Nominal, kind: Literal["point", "plane", "sphere"], place_mm: FloatArray, radius_mm: float
) -> Feature:
    """Return the nominal's own feature at a place of its surface: its normal there, or the sphere about it.

    Raises
    ------
    MeasurementError
        If the place lies off the surface, or the nominal has no such sphere there.
    """
    (away,), (normal,) = nominal.away(place_mm[None])
    if float(np.linalg.norm(away)) > radius_mm:
        to_do = message("Tell a place on the nominal's surface, in its own frame.")
        got = message("({place}), off it", place=_text(place_mm))
        raise MeasurementError("places on the nominal's surface", got, to_do, "datums")
    if kind != "sphere":
        return Feature(kind, place_mm - away, radius_mm, normal)
    corners = nominal.corners_mm[np.linalg.norm(nominal.corners_mm - place_mm, axis=1) < 2.2 * radius_mm]
    try:
        return Feature("sphere", fit_sphere(corners, 2 * radius_mm).center_mm, radius_mm, normal)
    except CalibrationError as error:
        need = message("a sphere of radius {radius_mm:g} mm on the nominal", radius_mm=radius_mm)
        to_do = message("Tell its center_mm.")
        raise MeasurementError(
            need, message("none at ({place})", place=_text(place_mm)), to_do, "datums"
        ) from error


def by_datums(
    points_mm: FloatArray, normals: FloatArray, nominal: Nominal, features: Sequence[Feature], start: Alignment
) -> DatumAlignment:
    """Return where the nominal lies if its features lie on those of the points.

    Parameters
    ----------
    points_mm, normals : (N, 3)
    nominal : Nominal
    features : sequence of Feature
    start : Alignment
        Of a best fit.

    Raises
    ------
    MeasurementError
        If a feature is not found among the points, or they do not hold the part: what is open is named.
    """
    pose, centre = start.cloud_from_reference.copy(), nominal.middle_mm
    places, directions = (np.concatenate(c) for c in zip(*(one.places() for one in features), strict=True))
    _require_held(rows_of(places, directions, np.eye(4), centre), nominal.extent_mm)
    good = np.isfinite(normals).all(axis=1)
    there = _in_reference(points_mm[good], normals[good], pose)[0]
    own: list[tuple[FloatArray, FloatArray]] = []
    for feature in features:  # all that may be of it, however the pose moves
        some = np.linalg.norm(there - feature.at_mm, axis=1) < 2 * feature.radius_mm
        own.append((points_mm[good][some], normals[good][some]))
    found: list[Measured] = []
    inverse: FloatArray = np.zeros((6, len(places)))
    for _ in range(_ROUNDS):
        found = [
            _measured(one, *_in_reference(*of_it, pose), start.rms_mm)
            for one, of_it in zip(features, own, strict=True)
        ]
        system = rows_of(places, directions, pose, centre)
        inverse = np.linalg.pinv(system).astype(float)
        step = inverse @ np.concatenate([one.values_mm for one in found])
        pose = stepped(pose, step, centre)
        if np.abs(step[3:]).max() < _LEAST_MM:
            break
    errors = np.zeros((len(places), len(places)))
    at = 0
    for one in found:
        block = slice(at, at := at + len(one.values_mm))
        errors[block, block] = one.covariance
    covariance = about_origin(inverse @ errors @ inverse.T, pose, centre)
    rms_mm = float(np.sqrt(np.mean(np.concatenate([one.distances_mm for one in found]) ** 2)))
    return DatumAlignment(pose, rms_mm, covariance, start.share, start.alike, tuple(features), tuple(found))


def seen_by(feature: Feature, points_mm: FloatArray, scan: NDArray[np.integer], scans: int) -> FloatArray:
    """Return the share (S,) that each scan has in a feature, by its patches (N, 3) of the nominal's frame."""
    far = np.linalg.norm(points_mm - feature.at_mm, axis=1)
    near = scan[far <= max(feature.radius_mm, np.partition(far, _FEWEST_PATCHES)[_FEWEST_PATCHES])]
    return np.bincount(near, minlength=scans) / len(near)


def _measured(feature: Feature, points_mm: FloatArray, normals: FloatArray, rms_mm: float) -> Measured:
    near = feature.near(points_mm, normals, _reach_mm(feature, rms_mm))
    design = feature.design(points_mm[near], normals[near])
    least = 1 if feature.kind == "point" else LEAST_POINTS
    if len(design) < least or np.linalg.matrix_rank(design) < design.shape[1]:
        place = _text(feature.at_mm)
        line = message("a single line of them at ({place})", place=place)
        got = message("none at ({place})", place=place) if len(design) < least else line
        to_do = message("Pick a place that was scanned, or a larger datum_radius_mm.")
        raise MeasurementError("points around each datum", got, to_do, "datums")
    points, off = points_mm[near], feature.off(points_mm[near])
    if feature.kind == "sphere":
        return _measured_sphere(feature, points)
    kept = np.ones(len(points), dtype=bool)
    values, left = _least(design, off, kept)
    for _ in range(_CUTS if feature.kind == "plane" else 0):
        before, spread = kept, 1.4826 * float(np.median(np.abs(left[kept])))
        kept = np.abs(left) <= _CUT * spread + _LEAST_MM
        if np.array_equal(before, kept):
            break
        values, left = _least(design, off, kept)
    count, squares = int(np.count_nonzero(kept)), float((left[kept] ** 2).sum())
    free = max(count - 3, 1) if feature.kind == "plane" else count**0.5  # errors in a touch are alike
    covariance: FloatArray = squares / free * np.linalg.inv(design[kept].T @ design[kept]).astype(float)
    return Measured(values, covariance, off[kept], (squares / count) ** 0.5, feature.radius_mm)


def _least(design: FloatArray, off: FloatArray, kept: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Return what fits the distances that are kept, and what is left of all."""
    values: FloatArray = np.linalg.lstsq(design[kept], off[kept])[0].astype(float)
    return values, off - design @ values


def _measured_sphere(feature: Feature, points: FloatArray) -> Measured:
    place = {"place": _text(feature.at_mm), "radius_mm": feature.radius_mm}
    need = message("a sphere of radius {radius_mm:g} mm at ({place})", **place)
    to_do = message("Scan more of it, or name another datum.")
    try:
        fit = fit_sphere(points)
    except CalibrationError as error:
        raise MeasurementError(need, error.got, to_do, "datums") from error
    if abs(fit.radius_mm - feature.radius_mm) > _OTHER_SIZE * feature.radius_mm:
        got = message("one of radius {radius_mm:.3f} mm", radius_mm=fit.radius_mm)
        raise MeasurementError(need, got, to_do, "datums")
    off = feature.off(points[fit.inliers])
    return Measured(fit.center_mm - feature.at_mm, fit.covariance[:3, :3], off, fit.rms_mm, fit.radius_mm, True)


def _reach_mm(feature: Feature, rms_mm: float) -> float:
    if feature.kind == "point":
        return feature.radius_mm
    return min(max(_NEAR * feature.radius_mm, _NEAR_RMS * rms_mm), feature.radius_mm / 2)


def _in_reference(points: FloatArray, normals: FloatArray, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    return (points - pose[:3, 3]) @ pose[:3, :3], normals @ pose[:3, :3]


def _require_held(system: FloatArray, extent_mm: float) -> None:
    """Refuse features that leave the part open, naming the directions in the nominal's frame."""
    scaled = system / np.array([extent_mm] * 3 + [1.0] * 3)
    values, vectors = np.linalg.svd(scaled)[1:]
    values = np.concatenate([values, np.zeros(6 - len(values))])
    free = vectors[values <= _OPEN * values[0]]
    if not len(free):
        return
    shifts = _open(scaled[:, 3:])
    turns = _echelon(np.linalg.svd(free[:, :3])[2][: len(free) - len(shifts)])
    said = [message("a shift along ({way})", way=_text(way)) for way in shifts]
    said += [message("a turn about ({way})", way=_text(way)) for way in turns]
    raise MeasurementError(
        "datums that hold the part in all six directions",
        message("some that leave open: {open}", open=said),
        message(
            "Place datums across that; for 3-2-1 three on the first surface, two on the second, one on the third."
        ),
        "datums",
    )


def _open(directions: FloatArray) -> FloatArray:
    """Return the ways that no direction goes along."""
    values, vectors = np.linalg.svd(directions)[1:]
    values = np.concatenate([values, np.zeros(3 - len(values))])
    return _echelon(vectors[values <= _OPEN * max(values[0], _OPEN)])


def _echelon(ways: FloatArray) -> FloatArray:
    """Return unit vectors that span the same, along the axes where they can."""
    ways = ways.copy()
    for row in range(len(ways)):
        column = int(np.argmax(np.abs(ways[row:]).max(axis=0) > 0.5 * np.abs(ways[row:]).max()))
        other = row + int(np.argmax(np.abs(ways[row:, column])))
        ways[[row, other]] = ways[[other, row]]
        ways[row] /= ways[row, column]
        rest = np.arange(len(ways)) != row
        ways[rest] -= ways[rest, column][:, None] * ways[row]
    return ways / np.linalg.norm(ways, axis=1, keepdims=True) + 0.0


def _text(place: FloatArray) -> str:
    return ", ".join(f"{value:.4g}" for value in place.round(3) + 0.0)
