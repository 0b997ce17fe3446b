"""Observations of captures as the arrays that the likelihood reads."""

from collections.abc import Sequence

import numpy as np

from calib_core.arms.alike import visits
from calib_core.cell.layout import Layout, MovedAxis, index_of
from calib_core.cell.walk import Carrier, Walk, ways
from calib_core.chain import scanner
from calib_core.chain.chain_data import ARM_SCALE_SIGMA, DRIFT_SIGMA_MM, ChainData
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.frames import FloatArray

_MOST_POINTS = 128  # a profile's arc in steps of about a degree: finer ones say the same
_EXACT_MM = 1e-9  # a radius known better is known: the information of less would be no number


def chain_data(
    observations: Observations,
    sphere: SphereSize,
    profile_sigma_mm: float | None,
    priors: scanner.ScannerPriors | None = None,
    layout: Layout | None = None,
) -> ChainData:
    """Return observations as arrays.

    Parameters
    ----------
    observations, sphere
    profile_sigma_mm : float or None
        The points' standard deviation in every profile.
    priors : ScannerPriors, optional
        None takes the scanner and the arm's lengths as exact.
    layout : Layout, optional
        What the ways may lead over; left out, what the observations say.
    """
    count = len(observations)
    layout = layout or layout_of(observations)
    seen = [np.abs(o.points_in_laser_mm[:, 0]).max() for o in observations if len(o.points_in_laser_mm)]
    half_width = float(max(seen, default=1.0))
    merged = [_merged_points(o) for o in observations]
    sigmas = np.array([_point_sigma(o, profile_sigma_mm) for o in observations])
    radii = np.array([o.size(sphere).radius_mm for o in observations])
    alike = np.array([o.points_per_independent for o in observations])
    weights = 1 / (sigmas**2 * alike)
    anchors, information, gradient = np.zeros((count, 3)), np.zeros((count, 11, 11)), np.zeros((count, 11))
    effective = np.zeros(count)
    for k, o in enumerate(observations):
        if o.kind == "profile":
            effective[k] = weights[k] * _scatter_left(o, *merged[k], radii[k])
        else:
            anchors[k] = o.center_in_laser_mm
            information[k], gradient[k] = _quadratic(o, radii[k], half_width)
    points = np.ascontiguousarray(np.concatenate([m[0] for m in merged]) if merged else np.empty((0, 3)))
    lengths = [len(m[0]) for m in merged]
    circles = np.array([[*o.center_in_laser_mm, o.circle_radius_mm or 0.0] for o in observations]).reshape(-1, 4)
    circles = np.repeat(circles, lengths, axis=0)
    # By x alone, in which a scanner's noise does not act: a point's own noise must not enter its shape.
    across = (points[:, 0] - circles[:, 0]) / np.maximum(circles[:, 3], 1e-12)
    cosine = np.sqrt(np.maximum(1 - across**2, 0.0)) * circles[:, 3] / np.repeat(radii, lengths)
    basis = np.column_stack([scanner.bow_of(points, half_width), scanner.incidence_shapes(cosine)])
    of_scanner = index_of([(o.scanner, o.carriers.scanner) for o in observations], layout.mounts)
    place = index_of([(o.carriers.ball, o.ball) for o in observations], layout.places)
    readings = [[o.readings.get(axis.name, 0.0) for axis in layout.axes] for o in observations]
    walk = ways(
        layout,
        [o.base_from_tool0 for o in observations],
        [o.carriers for o in observations],
        of_scanner,
        place,
        np.array(readings, dtype=float).reshape(count, len(layout.axes)),
    )
    rotations, translations = walk.across_robot()
    stop = _stops(walk)
    nuisance_of, kinds, nuisance_sigmas = _nuisances(observations, sphere, of_scanner, len(layout.mounts), priors)
    return ChainData(
        rotations=rotations,
        translations=translations,
        walk=walk,
        points=points,
        counts=np.concatenate([m[1] for m in merged]) if merged else np.empty(0),
        basis=np.ascontiguousarray(basis),
        offsets=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        weights=weights,
        effective=effective,
        anchors=anchors,
        anchor_information=information,
        anchor_gradient=gradient,
        radius_mm=float(radii[0]) if count else sphere.radius_mm,
        radii_mm=radii,
        nuisance_sigmas=nuisance_sigmas,
        nuisance_of=nuisance_of,
        kinds=kinds,
        half_width_mm=half_width,
        order=_order(stop),
        pose_scale=np.ones(count),
        points_per_independent=alike,
        bent=np.array([o.bent for o in observations]),
        stop=stop,
        held=layout.fixed.copy(),
        arm_scale_sigma=ARM_SCALE_SIGMA if priors else 0.0,
        drift_sigma_mm=DRIFT_SIGMA_MM if priors else 0.0,
    )


def layout_of(observations: Observations, axes: Sequence[MovedAxis] = ()) -> Layout:
    """Return the layout that observations lead over: scanners as the cell lists them, and balls as these saw them.

    Of axes that are not told, a ball that rides on one has it turn.
    """
    observations = sorted(observations, key=lambda o: o.listed)
    seen: list[tuple[str, Carrier]] = [(o.scanner, o.carriers.scanner) for o in observations]
    mounts = dict.fromkeys(seen)
    places = dict.fromkeys((o.carriers.ball, o.ball) for o in observations)
    told = {axis.name for axis in axes}
    others = dict.fromkeys(carrier for carrier, _ in places if carrier not in ("base", "tool0", *told))
    every = (*axes, *(MovedAxis(name) for name in others))
    return Layout(tuple(mounts) or Layout.mounts, tuple(places) or Layout.places, every)


def _stops(walk: Walk) -> np.ndarray:
    """Return which captures of several scanners or balls were taken at one stop of the robot: `ChainData.stop`."""
    numbers, ends = np.full(len(walk.scanner), -1), list(zip(walk.scanner, walk.place, strict=True))
    if len({*ends}) == 1:
        return numbers
    poses = np.hstack([walk.rotations.reshape(-1, 9), walk.translations, walk.readings])
    _, stop, count = np.unique(poses, axis=0, return_inverse=True, return_counts=True)
    stop = stop.ravel()
    several = np.array([len({ends[k] for k in np.flatnonzero(stop == n)}) > 1 for n in range(len(count))])
    some = several[stop] & (walk.over_robot != 0)
    numbers[some] = np.unique(stop[some], return_inverse=True)[1].ravel()
    return numbers


def _order(stop: np.ndarray) -> FloatArray:
    """Return when each capture was taken, −1 … 1; those at one stop at one time."""
    order = np.linspace(-1.0, 1.0, len(stop))
    together = stop >= 0
    taken = np.bincount(stop[together], order[together]) / np.maximum(np.bincount(stop[together]), 1)
    order[together] = taken[stop[together]]
    return order


def _point_sigma(observation: SphereObservation, profile_sigma_mm: float | None) -> float:
    return observation.common_sigma_mm or profile_sigma_mm or observation.point_sigma_mm or 1.0


def _nuisances(
    observations: Observations,
    sphere: SphereSize,
    of_scanner: np.ndarray,
    scanners: int,
    priors: scanner.ScannerPriors | None,
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Return each capture's eight nuisances (K, 8), the kind of each (N,), and how uncertain each is (N,).

    The first ball's radius and the first scanner's errors, then the other balls' and the other scanners'.
    """
    sizes = list(dict.fromkeys(o.size(sphere) for o in observations)) or [sphere]
    radii = [0, *range(scanner.COUNT, scanner.COUNT + len(sizes) - 1)]
    own = scanner.COUNT - 1
    first = [1, *range(scanner.COUNT + len(sizes) - 1, scanner.COUNT + len(sizes) - 1 + own * (scanners - 1), own)]
    kinds = np.array(
        [*range(scanner.COUNT), *[0] * (len(sizes) - 1), *list(range(1, scanner.COUNT)) * (scanners - 1)]
    )
    size = index_of([o.size(sphere) for o in observations], sizes)
    errors = np.array(first)[of_scanner][:, None] + np.arange(own)
    by_kind = priors.sigmas(0.0) if priors else scanner.nothing_believed(0.0)
    sigmas = by_kind[kinds]
    lines = {int(n) for o, n in zip(observations, of_scanner, strict=True) if len(o.points_in_laser_mm)}
    bows = [first[n] + scanner.NAMES.index("bow") - 1 for n in range(scanners) if n not in lines]
    sigmas[bows] = 0.0  # over a width that nobody knows, nothing is bowed
    told = np.array([one.sigma_mm / 2 for one in sizes])
    sigmas[radii] = np.where(told > _EXACT_MM, told, 0.0)
    return np.column_stack([np.array(radii)[size], errors]).astype(np.int64), kinds, sigmas


def _scatter_left(
    observation: SphereObservation, points: FloatArray, counts: FloatArray, sphere_radius_mm: float
) -> float:
    """Return the mean square, mm², of a profile's distances to the sphere that merged points still show.

    The density of points must count for as much as their distances do: those that cancelled where neighbours
    were merged no longer pull at the scales, and with them counted in full all captures together would.
    """
    circle = observation.circle_radius_mm or 0.0
    distances = np.hypot(*(points[:, [0, 2]] - observation.center_in_laser_mm[[0, 2]]).T) - circle
    many = len(points)
    zone = min(circle / sphere_radius_mm, 1.0)
    return float(zone**2 * (counts @ distances**2) / counts.sum() * many / max(many - 3, 1))


def _merged_points(observation: SphereObservation) -> tuple[FloatArray, FloatArray]:
    """Return a profile's points (n, 3), neighbours along the arc merged, and how many each stands for.

    Points are merged in angle and distance from the circle's centre, so that no chord shortens the radius.
    """
    points = observation.points_in_laser_mm
    if observation.kind != "profile":
        return np.empty((0, 3)), np.empty(0)
    if len(points) <= _MOST_POINTS:
        return points, np.ones(len(points))
    x, z = (points[:, [0, 2]] - observation.center_in_laser_mm[[0, 2]]).T
    middle = np.arctan2(z.mean(), x.mean())
    cosine, sine = np.cos(middle), np.sin(middle)
    angle = np.arctan2(z * cosine - x * sine, x * cosine + z * sine)
    order = np.argsort(angle, kind="stable")
    starts = np.linspace(0, len(points), _MOST_POINTS, endpoint=False).astype(int)
    counts = np.diff(np.append(starts, len(points))).astype(float)
    angle = np.add.reduceat(angle[order], starts) / counts + middle
    distance = np.add.reduceat(np.hypot(x, z)[order], starts) / counts
    plane = (
        observation.center_in_laser_mm
        + np.column_stack([np.cos(angle), 0 * angle, np.sin(angle)]) * (distance[:, None])
    )
    return plane, counts


def _quadratic(
    observation: SphereObservation, radius_mm: float, half_width_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return information (11, 11) and gradient (11,) of a cloud's or a measured centre's likelihood."""
    center = observation.center_in_laser_mm
    points = observation.points_in_laser_mm
    if observation.kind == "center" or len(points) == 0:
        jacobian = np.zeros((3, 11))
        jacobian[:, :3] = np.eye(3)
        jacobian[:, 4:8] = -scanner.displacements(center[None], np.zeros(1))[0]
        weighted = jacobian.T @ np.linalg.inv(observation.center_covariance)
        return weighted @ jacobian, np.zeros(11)
    offsets = points - center
    distances = np.linalg.norm(offsets, axis=1)
    normals = offsets / distances[:, None]
    moved = np.einsum("ni,nij->nj", normals, scanner.displacements(points, scanner.bow_of(points, half_width_mm)))
    # By x and y alone, in which a scanner's noise does not act, as for a profile.
    cosine = np.sqrt(np.maximum(1 - np.sum(offsets[:, :2] ** 2, axis=1) / radius_mm**2, 0.0))
    shapes = scanner.incidence_shapes(cosine)
    jacobian = np.column_stack([-normals, -np.ones(len(points)), moved, -shapes])
    weight = 1 / (observation.point_sigma_mm**2 * observation.points_per_independent)
    gradient = weight * jacobian.T @ (distances - radius_mm)
    return weight * jacobian.T @ jacobian, gradient + _density_slope(
        observation, normals, distances, radius_mm, half_width_mm
    )


def _density_slope(
    observation: SphereObservation,
    normals: FloatArray,
    distances: FloatArray,
    radius_mm: float,
    half_width_mm: float,
) -> FloatArray:
    """Return the gradient (11,) of the part of a cloud's density that `sphere_information` has of a profile's.

    Each point counts by its own squared distance: what a distance and its own derivative share of one point's
    noise, whether that is alike along the normal or along the ray.
    """
    from calib_core.kernels.chain import FLATTEST

    points = observation.points_in_laser_mm
    steep = np.abs(normals[:, 2]) > FLATTEST
    points, normals, distances = points[steep], normals[steep], distances[steep]
    weight = ((distances - radius_mm) / observation.point_sigma_mm) ** 2 / observation.points_per_independent
    by_point = weight[:, None] * normals / distances[:, None]
    by_point[:, 2] = -weight * (1 / normals[:, 2] - normals[:, 2]) / distances
    slope = np.zeros(11)
    slope[:3] = -by_point.sum(axis=0)
    moved = scanner.displacements(points, scanner.bow_of(points, half_width_mm))
    slope[4:8] = np.einsum("ni,nij->j", by_point, moved)
    slope[5] -= weight.sum()
    slope[6] -= float(np.sum(weight * normals[:, 0] / normals[:, 2]))
    return slope


def visits_of(data: ChainData) -> FloatArray:
    """Return how often each capture's scanner was at its pose, (K,)."""
    found, ends = np.ones(data.count), np.column_stack([data.walk.scanner, data.walk.place])
    rotations, translations = data.walk.across_robot(as_recorded=True)
    for end in np.unique(ends, axis=0):
        own = (ends == end).all(axis=1)
        found[own] = visits(rotations[own], translations[own])
    return found
