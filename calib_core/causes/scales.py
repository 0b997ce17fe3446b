"""Grossly wrong lengths: profiles whose x or z is stretched, all lengths by one factor, another sphere diameter.

A sphere cut by the plane of light is a circle: stretched in x or z it is an ellipse, whose axes tell the ratio of
the two scales, alike in all captures.  What both scales have in common, or the diameter, the robot's motions tell:
with the right one the sphere's centres lie closest together.  A few per mille are the scanner's ordinary errors;
the tcp stage finds these itself (`chain.scanner`).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of, read_points
from calib_core.captures.observe import arc_observation
from calib_core.causes.apply import settings_of
from calib_core.causes.search import MUCH_CLOSER, Posed, started
from calib_core.cell.carriers import carriers_of, with_diameter
from calib_core.chain.guesses import Sought, random_rotations
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.start import centers_of, find_start
from calib_core.errors import MeasurementError
from calib_core.findings import Finding
from calib_core.findings.codes import causes as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import BeforeAfter, Capture, Cell, Changes, ReadFile, RootCause, Session
from calib_core.sphere.arc import ArcFit, fit_arc
from calib_core.sphere.circle import fit_circle

LEAST_CAPTURES = 7
"""With fewer, wrong lengths may fit well by chance."""

_ASKED = 4  # profiles that tell the ratio of the scales
_BEGIN_AT = (1.0, 0.6, 1.7)
_ROUNDS, _LARGEST_STEP, _SETTLED_RATIO = 7, 1.5, 0.002
_SURELY_ROUND = 6.5  # the logarithm of a radius in its standard deviations, on half of the arcs
_LEAST_RATIO = 0.03  # of both axes, as far as the arcs' shape tells it
_LEAST_SCALE = 0.012  # smaller errors are the scanner's ordinary ones, which the tcp stage finds
_LEAST_DIAMETER = 0.01
_LARGEST = 3.0
_FAR = np.linspace(-np.log(_LARGEST), np.log(_LARGEST), 25)
_NEAR, _FINE, _FINEST = np.linspace(-0.2, 0.2, 9), np.linspace(-0.05, 0.05, 11), np.linspace(-0.008, 0.008, 9)
_STARTS, _ITERATIONS = 36, 12
_ENOUGH, _TOO_LARGE = 0.7, 1.01
_UNKNOWNS = 8  # of x and z alone: the scanner's rotation and two of its shifts, the sphere's place
_LOG_ODDS = 7.0  # 1000 : 1 that so much closer is no chance, with so many lengths to choose from
_DISAGREES = 4  # the power of the share of circles that are no larger than the sphere
_RIVAL, _PRICE_OF_TWO = 1.5, 1.5
_LARGEST_SCATTER_MM = 1.5
_AS_GOOD_AS_ARMS_MM = 0.15  # lengths that err by more than the ordinary leave three times as much
_MOST_ROUNDER = 0.7


@dataclass(frozen=True)
class _Lengths:
    """By what x and z are to be multiplied, or the sphere's diameter, and the scatter that this leaves."""

    x: float
    z: float
    diameter_mm: float
    told: bool  # whether the diameter is the one told
    scatter_mm: float
    price: float  # by which it is compared with others

    @property
    def is_ordinary(self) -> bool:
        """Whether scanner and sphere err by as little as they usually do."""
        return max(abs(np.log(self.x)), abs(np.log(self.z))) < _LEAST_SCALE and self.told


def scale_causes(
    session: Session, captures: Sequence[Capture], read: ReadFile, told: SphereSize, by_shape: bool = False
) -> list[Finding]:
    """Return what would make profiles of the still sphere fit far better: other lengths; the likeliest first.

    Parameters
    ----------
    session : Session
    captures : sequence of Capture
        Those that are solved.
    read : callable
        Returns the bytes of a file by its name in the capture.
    told : SphereSize
    by_shape : bool
        Whether only lengths are of interest by which circles are seen as ellipses.

    Raises
    ------
    InputError
        If a file or a pose is of no use.
    """
    used = [c for c in captures if not c.excluded]
    scanners = Counter(c.scanner for c in used)
    used = [c for c in used if c.scanner == scanners.most_common(1)[0][0]]  # each has a place of its own
    profiles = [c for c in used if c.kind == "profile"]
    if len(profiles) < max(LEAST_CAPTURES, len(used)):
        return []
    points = {c.id: seen for c in profiles if (seen := _seen(c, read)) is not None}
    profiles = [c for c in profiles if c.id in points]
    if len(profiles) < LEAST_CAPTURES:
        return []
    ratio = _ratio(list(points.values())[:: max(1, len(points) // _ASKED)])
    if by_shape and ratio == 1:
        return []
    as_told = SeenArcs.of(session, profiles, points, 1.0)
    now = as_told.scatter_mm(1.0, 1.0, told) if as_told is not None else np.inf
    seen = as_told if ratio == 1 else SeenArcs.of(session, profiles, points, ratio)
    if seen is None or (ratio == 1 and now < _AS_GOOD_AS_ARMS_MM):
        return []
    found = [*_factors(seen, ratio, told), *(_diameters(seen, told) if ratio == 1 else [])]
    closer = min(MUCH_CLOSER, float(np.exp(-_LOG_ODDS / (2 * len(profiles) - _UNKNOWNS))))
    found = [one for one in found if one.scatter_mm < _LARGEST_SCATTER_MM and one.price < closer * now]
    found.sort(key=lambda one: one.price)
    if not found or found[0].is_ordinary:
        return []
    found = [one for one in found if one.price < _RIVAL * found[0].price and not one.is_ordinary]
    return [_cause(one, now if np.isfinite(now) else None, told, session) for one in found]


def _seen(capture: Capture, read: ReadFile) -> FloatArray | None:
    """Return a profile's points, or nothing where nothing came back: such a capture tells no lengths."""
    try:
        return read_points(capture, read)
    except MeasurementError:
        return None


def _ratio(profiles: Sequence[FloatArray]) -> float:
    """Return by what x has to be multiplied for the arcs to be round, 1 where they are, within a few per cent."""
    best: tuple[float, float] | None = None
    as_told = 0.0
    for begin in _BEGIN_AT:
        ratio = begin
        for _ in range(_ROUNDS):
            arcs = [(points, _arc(points, ratio)) for points in profiles]
            some = [points[arc.inliers] for points, arc in arcs if arc is not None]
            roundness = _roundness([arc for _, arc in arcs])
            as_told = max(as_told, roundness) if ratio == 1 else as_told
            if best is None or roundness > best[0]:
                best = roundness, ratio
            before, ratio = ratio, _rounded(some, ratio) if some else ratio
            if abs(np.log(ratio / before)) < _SETTLED_RATIO:
                break
        if best is not None and best[0] > _SURELY_ROUND:
            break
    assert best is not None
    small = abs(np.log(best[1])) < _LEAST_RATIO
    return 1.0 if small or best[0] < as_told - np.log(_MOST_ROUNDER) else round(best[1], 4)


def _roundness(arcs: Sequence[ArcFit | None]) -> float:
    """Return the median logarithm of the circles' radii in their own standard deviations."""
    sharp = [0.0 if arc is None else np.log(arc.radius_mm / np.sqrt(arc.covariance[2, 2])) for arc in arcs]
    return float(np.median(sharp))


def _arc(points: FloatArray, ratio: float) -> ArcFit | None:
    try:
        return fit_arc(points * [ratio, 1.0], None)
    except MeasurementError:
        return None


def _rounded(arcs: Sequence[FloatArray], near: float) -> float:
    """Return the ratio at which points of arcs (N, 2) lie on circles: ellipses with upright axes share it.

    A circle after x is multiplied by s is s² x² + z² + D x + E z + F = 0, linear in all but s.
    """
    normal = np.zeros(2)
    for points in arcs:
        x, z = ((points - points.mean(axis=0)) / np.ptp(points, axis=0).max()).T
        rest = np.column_stack([x, z, np.ones_like(x)])
        both = np.column_stack([x**2, -(z**2)])
        left = both - rest @ np.linalg.lstsq(rest, both, rcond=None)[0]
        normal += [left[:, 0] @ left[:, 0], left[:, 0] @ left[:, 1]]
    square = normal[1] / max(normal[0], 1e-300)
    return float(np.clip(np.sqrt(max(square, 1e-4)), near / _LARGEST_STEP, near * _LARGEST_STEP))


@dataclass(frozen=True, eq=False)
class SeenArcs:
    """Arcs of whatever radius, x multiplied by `ratio`."""

    cell: Cell
    captures: list[Capture]
    arcs: list[tuple[FloatArray, ArcFit]]
    poses: list[RigidTransform]

    @property
    def across_robot(self) -> list[RigidTransform]:
        """The poses from what carries the scanner into what carries the ball."""
        ways = (carriers_of(self.cell, capture) for capture in self.captures)
        return [way.ball_from_scanner(pose) for way, pose in zip(ways, self.poses, strict=True)]

    @classmethod
    def of(
        cls, session: Session, captures: Sequence[Capture], points: dict[str, FloatArray], ratio: float
    ) -> "SeenArcs | None":
        """Return what profiles show; None where most show no arc."""
        found: list[tuple[Capture, FloatArray, ArcFit]] = []
        for capture in captures:
            arc = _arc(points[capture.id], ratio)
            if arc is not None:
                found.append((capture, (points[capture.id] * [ratio, 1.0])[arc.inliers], arc))
        if len(found) < max(LEAST_CAPTURES, round(_ENOUGH * len(captures))):
            return None
        used = [capture for capture, _, _ in found]
        poses = [pose_of(session.cell, capture) for capture in used]
        return cls(session.cell, used, [(some, arc) for _, some, arc in found], poses)

    def observed(self, x: float, z: float) -> list[SphereObservation]:
        """Return the arcs with x and z multiplied, their circles fitted anew."""
        found: list[SphereObservation] = []
        for capture, (points, arc), pose in zip(self.captures, self.arcs, self.poses, strict=True):
            start = np.array([arc.center_mm[0] * x, arc.center_mm[1] * z, arc.radius_mm * np.sqrt(x * z)])
            circle = fit_circle(points * [x, z], start).parameters
            fit = replace(arc, center_mm=circle[:2], radius_mm=float(circle[2]))
            found.append(arc_observation(self.cell, capture, pose, points * [x, z], fit))
        return found

    def circle_centers(self, scales: FloatArray) -> FloatArray:
        """Return about where the circles' centres are (N, K, 3), x and z multiplied by each of `scales` (N, 2).

        Algebraic circles, from sums of powers that are taken once an arc: near enough to search by.
        """
        found = np.zeros((len(scales), len(self.arcs), 3))
        sx, sz = scales.T
        for k, (points, _) in enumerate(self.arcs):
            middle = points.mean(axis=0)
            x, z = (points - middle).T
            xx, xz, zz = float(x @ x), float(x @ z), float(z @ z)
            right_x = (sx**3 * float(x @ x**2) + sx * sz**2 * float(x @ z**2)) / 2
            right_z = (sz**3 * float(z @ z**2) + sz * sx**2 * float(z @ x**2)) / 2
            det = (sx * sz) ** 2 * (xx * zz - xz**2)
            off_x = (right_x * sz**2 * zz - right_z * sx * sz * xz) / det
            off_z = (right_z * sx**2 * xx - right_x * sx * sz * xz) / det
            found[:, k, 0] = middle[0] * sx + off_x
            found[:, k, 2] = middle[1] * sz + off_z
        return found

    def scatter_mm(self, x: float, z: float, sphere: SphereSize, near: FloatArray | None = None) -> float:
        """Return how far apart the sphere's centres lie; without end where most circles are larger than it."""
        some = [o for o in self.observed(x, z) if (o.circle_radius_mm or 0.0) < _TOO_LARGE * sphere.radius_mm]
        if len(some) < max(LEAST_CAPTURES, round(_ENOUGH * len(self.captures))):
            return float("inf")
        centers = centers_of(some, sphere)
        if near is None:
            return find_start(centers).scatter_mm
        posed = Posed([o.ball_from_scanner for o in some], np.ones(len(some), dtype=bool))
        return started(posed, centers, [near]).scatter_mm


def _factors(seen: SeenArcs, ratio: float, told: SphereSize) -> list[_Lengths]:
    """Return by what x alone, z alone or both are to be multiplied so that the sphere's centres lie closest."""
    families: list[tuple[FloatArray, FloatArray, FloatArray]] = [
        (np.array([1.0, 1.0]), np.array([1.0, 0.0]), _NEAR),
        (np.array([1 / ratio, 1 / ratio]), np.array([0.0, 1.0]), _NEAR),
        (np.array([1.0, 1.0]), np.array([1.0, 1.0]), _FAR),
    ]
    found: list[_Lengths] = []
    for begin, axes, steps in families:
        scales, turned = begin, random_rotations(_STARTS)
        for logarithms in (steps, _FINE, _FINEST):
            scales, turned = _closest(seen, told, scales * np.exp(np.outer(logarithms, axes)), turned)
        x, z = float(scales[0]) * ratio, float(scales[1])
        scatter = seen.scatter_mm(float(scales[0]), z, told, turned[0])
        price = 1.0 if ratio == 1 or not axes.all() else _PRICE_OF_TWO
        price /= min(1.0, np.sqrt(x * z))  # what is made smaller scatters less, right or wrong
        found.append(_Lengths(x, z, told.diameter_mm, True, scatter, price * scatter))
    return found


def _closest(
    seen: SeenArcs, told: SphereSize, scales: FloatArray, turned: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the scales, of (N, 2), by which centres lie closest together, and the scanner's rotation (1, 3, 3).

    The search leaves out y, whose sign a profile does not tell.
    """
    measured = seen.circle_centers(scales)
    count = len(turned)
    shape = (len(scales) * count, len(seen.poses))
    poses = seen.across_robot
    rotations = np.broadcast_to(np.array([pose.rotation for pose in poses]), (*shape, 3, 3))
    translations = np.broadcast_to(np.array([pose.translation_mm for pose in poses]), (*shape, 3))
    weight = np.broadcast_to(np.array([1.0, 0.0, 1.0]), (*shape, 3))
    sought = Sought(rotations, translations, np.repeat(measured, count, axis=0), weight)
    starts = np.tile(turned, (len(scales), 1, 1))
    found, _, misfit = sought.refined(starts, sought.linear_unknowns(starts), _ITERATIONS)
    best = int(np.argmin(np.median(sought.distances(misfit), axis=1)))
    return scales[best // count], found[best][None]


def _diameters(seen: SeenArcs, told: SphereSize) -> list[_Lengths]:
    """Return the diameter at which the sphere's centres lie closest together: x and z do not depend on it."""
    from scipy.optimize import minimize_scalar

    _, turned = _closest(seen, told, np.ones((1, 2)), random_rotations(_STARTS))
    radii = np.array([arc.radius_mm for _, arc in seen.arcs]) / told.radius_mm
    least = float(np.quantile(radii, _ENOUGH)) / _TOO_LARGE  # no circle is larger than its sphere

    def at(logarithm: float) -> float:
        factor = float(np.exp(logarithm))
        fitting = float(np.mean(radii < _TOO_LARGE * factor))  # few captures agree by chance
        scatter = seen.scatter_mm(1.0, 1.0, SphereSize(factor * told.diameter_mm), turned[0])
        return scatter / fitting**_DISAGREES

    # The scatter jumps where a circle becomes larger than the sphere: no descent leads past that.
    tried = np.linspace(np.log(least), np.log(max(_LARGEST, 1.5 * least)), 32)
    for finer in (True, False):
        k = int(np.argmin([at(float(one)) for one in tried]))
        ends = tried[max(k - 1, 0)], tried[min(k + 1, len(tried) - 1)]
        tried = np.linspace(*ends, 13) if finer else tried
    found: Any = minimize_scalar(at, bounds=ends, method="bounded", options={"xatol": 1e-3})
    if abs(found.x) < _LEAST_DIAMETER:
        return []
    diameter = float(np.exp(found.x)) * told.diameter_mm
    return [_Lengths(1.0, 1.0, diameter, False, float(found.fun), float(found.fun))]


def _cause(one: _Lengths, now: float | None, told: SphereSize, session: Session) -> Finding:
    before = now if now is not None and np.isfinite(now) else None
    label = "Scatter of the sphere's centre"
    evidence = [BeforeAfter(label=label, unit="mm", before=before, after=one.scatter_mm)]
    values: dict[str, Any] = {
        "compared": "alone" if before is None else "instead",
        "after_mm": one.scatter_mm,
        "before_mm": before or 0.0,
    }
    if not one.told:
        diameter = _plain(one.diameter_mm)
        remedy = RootCause(
            id=f"sphere-diameter-{diameter:g}",
            kind="sphere-diameter",
            evidence=evidence,
            changes=Changes(cell=with_diameter(session.cell, told.diameter_mm, diameter)),
        )
        return codes.SPHERE_DIAMETER_WRONG(remedy=remedy, diameter_mm=diameter, told_mm=told.diameter_mm, **values)
    settings = {f"{axis}_scale": round(scale, 4) for axis, scale in (("x", one.x), ("z", one.z)) if scale != 1}
    remedy = RootCause(
        id=f"scaled-profile-{'-'.join(f'{name[0]}-{scale:g}' for name, scale in settings.items())}"[:64],
        kind="scaled-profile",
        evidence=evidence,
        changes=settings_of(settings, session.captures),
        point_settings=settings,
    )
    factors = ", ".join(f"{name[0]} × {scale:.3f}" for name, scale in settings.items())
    return codes.SCALED_PROFILE(remedy=remedy, factors=factors, **values)


def _plain(diameter_mm: float) -> float:
    """Return a diameter as spheres are made, where it is near to that."""
    for step in (1.0, 0.5, 0.1):
        nearest = round(diameter_mm / step) * step
        if abs(nearest - diameter_mm) < 0.002 * diameter_mm:
            return round(nearest, 6)
    return round(diameter_mm, 2)
