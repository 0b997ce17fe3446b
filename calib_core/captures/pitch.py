"""A wrong pitch of the board, told by the sphere: all lengths of frames are then off by one factor.

Scaled back by the right factor, the arcs fit the sphere's diameter and the robot's motions; the factor at which
the sphere's centres lie closest together tells the pitch.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of, sphere_of
from calib_core.captures.observe import arc_observation
from calib_core.captures.stripe_frames import read_profile_frame
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.start import centers_of, find_start
from calib_core.errors import CalibrationError, MeasurementError
from calib_core.findings import Finding
from calib_core.findings.codes.tcp import BOARD_PITCH
from calib_core.records import Capture, ReadFile, Session
from calib_core.sphere.arc import fit_arc

_LEAST_CAPTURES = 6
_LARGEST = 3.0  # times too large or too small; beyond, the board is another one
_COARSE = 1.08
_SETTLED = 0.001
_LEAST_DIFFERENCE = 0.005
_MUCH_CLOSER = 0.5


def suspected_pitch(session: Session, captures: Sequence[Capture], read: ReadFile) -> Finding | None:
    """Return what frames of the sphere say of the board's pitch; None where no board gave lengths.

    Parameters
    ----------
    session : Session
    captures : sequence of Capture
        Of the sphere.
    read : callable
    """
    cell = session.cell
    frames = [c for c in captures if c.kind == "frame" and not c.excluded]
    if cell.known.laser_plane is not None or cell.board is None or not frames:
        return None
    factor, told_mm = _factor(_observed(session, frames, read), sphere_of(cell, frames)), cell.board.pitch_mm
    if factor is None:
        return BOARD_PITCH(likely="open", pitch_mm=told_mm)
    likely_mm = _rounded(told_mm / factor)
    return BOARD_PITCH(likely="told", pitch_mm=told_mm, factor=1 / factor, likely_mm=likely_mm)


def _observed(session: Session, frames: Sequence[Capture], read: ReadFile) -> list[SphereObservation]:
    """Return the arcs, of whatever radius, that the frames show."""
    observed: list[SphereObservation] = []
    for capture in frames:
        try:
            profile = read_profile_frame(session, capture, read)
            arc = fit_arc(profile, None, session.cell.scanner.z_axis)
        except MeasurementError:
            continue
        pose = pose_of(session.cell, capture)
        observed.append(arc_observation(session.cell, capture, pose, profile[arc.inliers], arc))
    return observed


def _factor(observed: list[SphereObservation], sphere: SphereSize) -> float | None:
    """Return how many times too large the lengths are; None where the captures do not tell."""
    from scipy.optimize import minimize_scalar

    if len(observed) < _LEAST_CAPTURES:
        return None

    def scatter_mm(factor: float) -> float:
        try:
            start = find_start(centers_of([_scaled(o, factor) for o in observed], sphere))
        except (CalibrationError, np.linalg.LinAlgError):
            return np.inf
        return start.scatter_mm

    def scatter_of(logarithm: float) -> float:
        return scatter_mm(float(np.exp(logarithm)))

    radii = np.array([o.circle_radius_mm or 0.0 for o in observed]) / sphere.radius_mm
    least = max(1 / _LARGEST, float(np.median(radii)))  # no circle is larger than the sphere, but for spoiled ones
    factors = np.exp(np.arange(np.log(least), np.log(_LARGEST), np.log(_COARSE)))
    costs = np.array([scatter_mm(f) for f in factors])
    best = int(np.argmin(costs))
    ends = np.log(factors[max(best - 1, 0)]), np.log(factors[min(best + 1, len(factors) - 1)])
    found: Any = minimize_scalar(scatter_of, bounds=ends, method="bounded", options={"xatol": _SETTLED})
    factor = float(np.exp(found.x))
    clear = scatter_mm(factor) < _MUCH_CLOSER * scatter_mm(1.0)
    return factor if clear and abs(factor - 1) > _LEAST_DIFFERENCE else None


def _scaled(observation: SphereObservation, factor: float) -> SphereObservation:
    return replace(
        observation,
        points_in_laser_mm=observation.points_in_laser_mm / factor,
        center_in_laser_mm=observation.center_in_laser_mm / factor,
        center_covariance=observation.center_covariance / factor**2,
        circle_radius_mm=(observation.circle_radius_mm or 0.0) / factor,
        point_sigma_mm=observation.point_sigma_mm / factor,
    )


def _rounded(pitch_mm: float) -> str:
    """Return a pitch as boards are made, where it is near to that."""
    nearest = round(pitch_mm * 10) / 10
    return f"{nearest:.1f}" if abs(nearest - pitch_mm) < 0.01 * pitch_mm else f"{pitch_mm:.2f}"
