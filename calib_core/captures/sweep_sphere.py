"""The sphere in a sweep: every profile in which its arc is found is an observation of its own."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.captures.content import diameter_in_sight_mm, shows_sphere, sphere_of, thinned
from calib_core.captures.lost_rays import SeenPoints, lost_rays
from calib_core.captures.measured import figures_of, measured_of, not_seen
from calib_core.captures.observation_cache import seen_once
from calib_core.captures.observe import arc_observation, point_settings
from calib_core.captures.standstill import standstill_findings, still_of
from calib_core.captures.sweep import sweep_poses, sweep_profile
from calib_core.chain.observations import SphereObservation
from calib_core.errors import MeasurementError
from calib_core.findings import Finding
from calib_core.findings.codes.quality import FEW_PROFILES, SWEEP_EMPTY, SWEEP_OF_OBJECT, SWEEP_PROFILES
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.records import Capture, Measured, ReadFile, Session, Still
from calib_core.sphere.arc import ArcFit, fit_arc

MOST_PROFILES = 60
"""More profiles with arcs than this are thinned: their neighbours say the same, and each costs the solver time."""

_FEW_PROFILES = 5


@dataclass(frozen=True, eq=False)
class _Profile:
    """One profile of a sweep: where the scanner stood, its points (N, 2), and why they show no arc, if so."""

    pose: RigidTransform
    points: FloatArray
    found: ArcFit | MeasurementError
    without_ray: int


def observe_sweep(session: Session, capture: Capture, read: ReadFile) -> list[SphereObservation]:
    """Return the sphere as each profile of a sweep saw it that shows its arc; at most `MOST_PROFILES` of them.

    More are thinned evenly.  Profiles without an arc are no fault: the stripe comes and leaves.

    Raises
    ------
    InputError
        If a file or a pose is of no use, their numbers differ, or a time lies outside the pose track.
    MeasurementError
        If no profile shows the sphere.
    """
    profiles = list(_profiles(session, capture, read))
    arcs = _arcs(profiles)
    if not arcs:
        raise _no_arc(profiles).at(capture.id)
    return [
        arc_observation(session.cell, capture, seen.pose, seen.points[arc.inliers], arc, seen.without_ray)
        for seen, arc in (arcs[k] for k in _spread(len(arcs)))
    ]


def measure_sweep(session: Session, capture: Capture, read: ReadFile) -> Measured:
    """Return in how many profiles of a sweep the sphere is seen; of an object's sweep, how many points there are.

    Raises
    ------
    InputError
        As `observe_sweep` does.
    """
    if not shows_sphere(capture):
        return _measured_object(session, capture, read)
    profiles = list(_profiles(session, capture, read))
    arcs = _arcs(profiles)
    points = sum(len(profile.points) for profile in profiles)
    without_ray = sum(profile.without_ray for profile in profiles)
    if not arcs:
        return not_seen(capture, _no_arc(profiles), points=points, without_ray=without_ray, profiles=0)
    still = still_of((seen.pose, arc) for seen, arc in arcs)
    noticed = standstill_findings(still) or [_count(len(arcs), len(profiles), still)]
    fullest, largest = max(arcs, key=lambda pair: pair[1].radius_mm)
    return measured_of(
        capture,
        [*noticed, *lost_rays(without_ray)],
        still=still,
        points=points,
        without_ray=without_ray,
        on_sphere=sum(int(arc.inliers.sum()) for _, arc in arcs),
        profiles=len(arcs),
        **figures_of(largest, fullest.points, largest.inliers, diameter_in_sight_mm(session.cell, capture)),
    )


def _measured_object(session: Session, capture: Capture, read: ReadFile) -> Measured:
    poses = sweep_poses(session.cell, capture)
    seen = [sweep_profile(session, capture, name, read, may_be_blank=True) for name in capture.files]
    profiles = [one.points for one in seen]
    fullest = max(profiles, key=len)
    points = sum(map(len, profiles))
    preview = thinned(fullest) if points else []
    without_ray = sum(one.without_ray for one in seen)
    noticed = SWEEP_OF_OBJECT(count=len(poses)) if points else SWEEP_EMPTY()
    return measured_of(
        capture,
        [noticed, *lost_rays(without_ray)],
        points=points,
        without_ray=without_ray,
        preview=preview,
        preview_on_sphere=[False] * len(preview),
    )


def _profiles(session: Session, capture: Capture, read: ReadFile) -> Iterator[_Profile]:
    cell = session.cell
    sphere_of(cell, [capture])
    poses = sweep_poses(cell, capture)
    for pose, name in zip(poses, capture.files, strict=True):
        seen = SeenPoints(np.empty((0, 2)))
        try:
            seen = sweep_profile(session, capture, name, read, may_be_blank=True)
            found = _arc_in(session, capture, name, seen.points, read)
        except MeasurementError as error:
            found = error
        yield _Profile(pose, seen.points, found, seen.without_ray)


def _arc_in(session: Session, capture: Capture, name: str, points: FloatArray, read: ReadFile) -> ArcFit:
    """Return the arc in one profile of a sweep; raises MeasurementError where there is none."""
    told = point_settings(session, capture, read)
    diameter_mm, z_axis = diameter_in_sight_mm(session.cell, capture), session.cell.scanner.z_axis
    return seen_once(ArcFit, [name], read, told, lambda: fit_arc(points, diameter_mm, z_axis))


def _arcs(profiles: list[_Profile]) -> list[tuple[_Profile, ArcFit]]:
    return [(profile, profile.found) for profile in profiles if isinstance(profile.found, ArcFit)]


def _no_arc(profiles: list[_Profile]) -> MeasurementError:
    """Return why the profile with the most points shows no sphere, said of the whole sweep."""
    fullest = max(profiles, key=lambda profile: len(profile.points)).found
    assert isinstance(fullest, MeasurementError)
    got = message("{found} (none of {count} profiles shows it)", found=fullest.got, count=len(profiles))
    return MeasurementError(fullest.need, got, fullest.to_do, fullest.where)


def _count(arcs: int, profiles: int, still: Still | None) -> Finding:
    """Return how many profiles of a sweep show the sphere; too few are a doubt."""
    enough = arcs >= _FEW_PROFILES or (still is not None and still.exposures == arcs)
    used = "thinned" if arcs > MOST_PROFILES else "all"
    code = SWEEP_PROFILES if enough else FEW_PROFILES
    return code(used=used, arcs=arcs, profiles=profiles, most=MOST_PROFILES)


def _spread(count: int) -> NDArray[np.intp]:
    return np.linspace(0, count - 1, min(count, MOST_PROFILES)).round().astype(np.intp)
