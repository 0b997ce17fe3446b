"""The sphere in a raw cloud: found among stands, background and stray points, with covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import plural
from calib_core.sphere.circle import CUT_IN_SIGMAS, KEPT_VARIANCE
from calib_core.sphere.diagnosis import points_as_rows, radius_mismatch, require_diameter

LEAST_POINTS = 20

_SEED_POINTS = 2048
_SAMPLE_POINTS = 8192
_SEED_BAND = 0.015  # of the radius
_START_BAND = 0.03  # of the radius
_DRAWS = 4000
_LEAST_DRAWS = 500
_TRIES = 4
_SETTLED = 0.03  # of the cut: a smaller step over all points changes nothing that counts
_LARGEST_RMS = 0.03  # of the radius
_BEYOND_DOUBT_CUT = 0.02  # of the radius
_MOST_BACKGROUND = 0.15  # share of the inliers that chance would put there
_FLATTEST_CAP = 0.97  # length of the mean unit normal: 1 for a plane, (1 + cos a) / 2 for a cap to the angle a
_WEAKEST_DIRECTION = 1e-5  # smallest eigenvalue of the mean of the derivative's outer products


@dataclass(frozen=True, eq=False)
class SphereFit:
    """A sphere in L.

    Attributes
    ----------
    center_mm : (3,)
    radius_mm : float
        As known, or as fitted.
    covariance : (3, 3) or (4, 4)
        Of the centre x, y, z where the diameter is known; of x, y, z, r where it is free; mm², for independent
        point errors of `point_sigma_mm`.
    rms_mm : float
        Root mean square of the inliers' distances to the sphere.
    point_sigma_mm : float
        Standard deviation of one point along the normal, estimated from the inliers.
    inliers : (N,) bool
        The points of the cloud that lie on the sphere.
    """

    center_mm: FloatArray
    radius_mm: float
    covariance: FloatArray
    rms_mm: float
    point_sigma_mm: float
    inliers: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Step:
    """One Gauss–Newton step of a sphere over the points within a cut."""

    sphere: FloatArray  # x, y, z, r after the step
    normal_matrix: FloatArray  # (3, 3) or (4, 4)
    count: int
    squared_sum: float  # of the residuals after the step, to first order
    mean_normal: float
    inliers: NDArray[np.bool_]


def fit_sphere(points_in_laser_mm: ArrayLike, diameter_mm: float | None = None) -> SphereFit:
    """Find the sphere in a cloud and fit it by least squares of geometric distance.

    Spheres through neighbouring points of a small sample give a start (a fixed sequence of draws), a larger sample
    refines it with a cut that follows the points' spread, and one or few passes over all points give the result.
    Covariance: σ² (JᵀJ)⁻¹ of the distance's derivative −u, or (−u, −1) where the radius is free.

    Parameters
    ----------
    points_in_laser_mm : (N, 3)
        Rows with NaN are blanks (organised clouds have them).
    diameter_mm : float or None
        The sphere's diameter; None fits it as well.

    Raises
    ------
    MeasurementError
        If there are too few points, no sphere, or one that contradicts the diameter (the likely reason is named).
    """
    points = np.ascontiguousarray(points_as_rows(points_in_laser_mm, 3, "cloud"))
    require_diameter(diameter_mm)
    sample = _sample(points)
    sphere, cut = _found(sample, diameter_mm)
    step = _over_all(points, sphere, cut, free=diameter_mm is None)
    unknowns = len(step.normal_matrix)
    sigma_mm = float(np.sqrt(step.squared_sum / (max(step.count - unknowns, 1) * KEPT_VARIANCE)))
    return SphereFit(
        center_mm=step.sphere[:3].copy(),
        radius_mm=float(step.sphere[3]),
        covariance=np.asarray(sigma_mm**2 * np.linalg.inv(step.normal_matrix), dtype=float),
        rms_mm=float(np.sqrt(step.squared_sum / step.count)),
        point_sigma_mm=sigma_mm,
        inliers=step.inliers,
    )


def _over_all(points: FloatArray, sphere: FloatArray, cut: float, free: bool) -> _Step:
    """Return the step over every point from a sphere that a sample gave; one pass is enough for large clouds.

    Cutting about a centre that is off by e leaves 2cφ(c)·e ≈ 0.006 e of the error after the step.
    """
    passes = 0
    while True:
        step = _step(points, sphere, cut, free, mark=True)
        moved = float(np.abs(step.sphere - sphere).max())
        passes += 1
        if (moved < _SETTLED * cut and (moved < 1e-6 * cut or len(points) > _SAMPLE_POINTS)) or passes == 20:
            return step
        sphere = step.sphere


def _sample(points: FloatArray) -> FloatArray:
    """Return about `_SAMPLE_POINTS` finite points, one at random from each stretch of the cloud's order."""
    sample = points if len(points) <= _SAMPLE_POINTS else points[_stretches(len(points), _SAMPLE_POINTS)]
    finite = np.isfinite(sample).all(axis=1)
    if finite.mean() < 0.5 and len(sample) < len(points):  # mostly blanks: look for the points before sampling
        points = points[np.isfinite(points).all(axis=1)]
        sample = points if len(points) <= _SAMPLE_POINTS else points[_stretches(len(points), _SAMPLE_POINTS)]
        finite = np.ones(len(sample), dtype=bool)
    if np.isinf(sample).any():
        to_do = "Write blanks or NaN where the scanner saw nothing."
        raise MeasurementError("finite numbers, or NaN where nothing came back", "infinity in the cloud", to_do)
    sample = sample[finite]
    if len(sample) < LEAST_POINTS:
        raise MeasurementError(
            "a cloud of at least {least_points} points",
            plural(
                "{count} point and {count_other} blanks",
                "{count} points and {count_other} blanks",
                by="count",
                count=len(sample),
                count_other=len(points) - len(sample),
            ),
            "Bring the sphere into the scanner's range and check the exposure.",
            least_points=LEAST_POINTS,
        )
    return sample


def _stretches(count: int, wanted: int) -> NDArray[np.intp]:
    jitter = np.random.default_rng(20240117).uniform(size=wanted)
    return ((np.arange(wanted) + jitter) * (count / wanted)).astype(np.intp)


def _found(sample: FloatArray, diameter_mm: float | None) -> tuple[FloatArray, float]:
    """Return the sphere (x, y, z, r) of the sample and the cut that parts its points from the others."""
    if diameter_mm is None:
        found = _search(sample, None)
        if found is None:
            raise _no_sphere()
        return found
    found = _search(sample, diameter_mm / 2)
    if found is not None:
        return found
    other = _search(sample, None)
    if other is None or abs(other[0][3] - diameter_mm / 2) < 0.02 * diameter_mm / 2:
        raise _no_sphere()
    raise radius_mismatch(float(other[0][3]), diameter_mm, "sphere")


def _no_sphere() -> MeasurementError:
    need = "a sphere in the cloud"
    to_do = "See that a quarter of the sphere or more is in view, and that the cloud holds several stripes of it."
    return MeasurementError(need, "none: nothing in it is round enough on every side that is seen", to_do)


def _search(sample: FloatArray, radius_mm: float | None) -> tuple[FloatArray, float] | None:
    """Return a sphere that stands every check, trying again without the points of those that did not."""
    from calib_core.kernels.sphere import first_spheres

    origin = np.median(sample, axis=0)
    everything = left = sample - origin
    reach = 1.8 * radius_mm if radius_mm else float(np.linalg.norm(np.ptp(left, axis=0)))
    for _ in range(_TRIES):
        if len(left) < LEAST_POINTS:
            return None
        # Neighbours are drawn blindly, so the few points of the seed must come from everywhere.
        seed = left[_stretches(len(left), _SEED_POINTS)] if len(left) > _SEED_POINTS else left
        least_draws = 40 if radius_mm else _LEAST_DRAWS
        firsts = first_spheres(seed, radius_mm or 0.0, reach, _SEED_BAND, 0.0, least_draws, _DRAWS)
        firsts = firsts[firsts[:, 4] >= LEAST_POINTS / 2]
        if len(firsts) == 0:
            return None
        found: list[tuple[float, FloatArray, float]] = []
        for first in firsts[np.argsort(-firsts[:, 4], kind="stable")]:
            refined = _refined(everything, first[:4], free=radius_mm is None)
            if refined is not None and _stands(everything, *refined, radius_mm):
                found.append((_sharpness(everything, *refined), *refined))
                if refined[1] < _BEYOND_DOUBT_CUT * refined[0][3]:
                    break  # smooth and round: the candidates of less support need not be tried
        if found:
            _, sphere, cut = max(found, key=lambda one: one[0])
            return sphere + np.array([*origin, 0.0]), cut
        best = firsts[np.argmax(firsts[:, 4])]
        distance = np.abs(np.linalg.norm(left - best[:3], axis=1) - best[3])
        left = left[distance > _START_BAND * best[3]]
    return None


def _sharpness(points: FloatArray, sphere: FloatArray, cut: float) -> float:
    """Return how well a sphere is determined: its radius in standard deviations of the radius."""
    step = _step(points, sphere, cut, free=True)
    return float(sphere[3]) / max(_sigma_radius(step, float(np.sqrt(step.squared_sum / step.count))), 1e-300)


def _refined(points: FloatArray, sphere: FloatArray, free: bool) -> tuple[FloatArray, float] | None:
    """Follow a first sphere to the one that its own points define, or return None where it dissolves."""
    start_radius = float(sphere[3])
    cut = widest = _START_BAND * start_radius
    count = -1
    for _ in range(25):
        step = _step(points, sphere, cut, free)
        if step.count < LEAST_POINTS or not start_radius / 3 < step.sphere[3] < 3 * start_radius:
            return None
        moved = float(np.abs(step.sphere - sphere).max())
        sphere = step.sphere
        distance = np.abs(np.linalg.norm(points - sphere[:3], axis=1) - sphere[3])
        within = distance[distance < cut]
        if len(within) < LEAST_POINTS:
            return None
        sigma = 1.4826 * float(np.median(within))
        before, cut = cut, min(widest, max(CUT_IN_SIGMAS * sigma, 1e-7 * sphere[3]))
        if moved < 1e-3 * sigma and abs(cut - before) < 1e-3 * cut and step.count == count:
            break
        count = step.count
    return sphere, cut


def _stands(points: FloatArray, sphere: FloatArray, cut: float, radius_mm: float | None) -> bool:
    """Whether the points are a sphere at all, and of the known radius: enough, smooth, bent, dense, determined."""
    step = _step(points, sphere, cut, free=True)
    rms = float(np.sqrt(step.squared_sum / max(step.count, 1)))
    distance = np.abs(np.linalg.norm(points - sphere[:3], axis=1) - sphere[3])
    background = np.count_nonzero((distance > 1.2 * cut) & (distance < 3.2 * cut)) / 2
    is_clear = (
        step.count >= LEAST_POINTS
        and rms < _LARGEST_RMS * sphere[3]
        and step.mean_normal < _FLATTEST_CAP
        and background < _MOST_BACKGROUND * step.count
    )
    if not is_clear:
        return False
    if radius_mm is None:
        return bool(np.linalg.eigvalsh(step.normal_matrix / step.count)[0] > _WEAKEST_DIRECTION)
    if abs(step.sphere[3] - radius_mm) < 0.005 * radius_mm:
        return True
    refined = _refined(points, sphere, free=True)
    if refined is None:  # too little of the sphere may be seen to say its radius; the known one stands then
        return _sigma_radius(step, rms) > 0.1 * radius_mm
    freed = _step(points, *refined, free=True)
    return abs(freed.sphere[3] - radius_mm) < max(5 * _sigma_radius(freed, rms), 0.02 * radius_mm)


def _sigma_radius(step: _Step, sigma_mm: float) -> float:
    return sigma_mm * float(np.sqrt(max(np.linalg.pinv(step.normal_matrix)[3, 3], 0.0)))


def _step(points: FloatArray, sphere: FloatArray, cut: float, free: bool, mark: bool = False) -> _Step:
    """Take a Gauss–Newton step over the points nearer than `cut`; `mark` says which these were."""
    from calib_core.kernels.sphere import sphere_sums

    inliers = np.empty(len(points) if mark else 0, dtype=np.bool_)
    s = sphere_sums(points, sphere[0], sphere[1], sphere[2], sphere[3], cut, inliers, mark)
    n, ux, uy, uz, xx, xy, xz, yy, yz, zz, rx, ry, rz, r1, r2 = s.tolist()
    matrix = np.array([[xx, xy, xz, ux], [xy, yy, yz, uy], [xz, yz, zz, uz], [ux, uy, uz, n]])
    gradient = np.array([rx, ry, rz, r1])
    size = 4 if free else 3
    matrix, gradient = matrix[:size, :size], gradient[:size]
    change = np.zeros(4)
    change[:size] = np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0] if n else 0.0
    return _Step(
        sphere=sphere + change,
        normal_matrix=matrix,
        count=int(n),
        squared_sum=max(float(r2 - gradient @ change[:size]), 0.0),
        mean_normal=float(np.sqrt(ux * ux + uy * uy + uz * uz)) / max(n, 1.0),
        inliers=inliers,
    )
