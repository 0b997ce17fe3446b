"""Exposures of the scanner as points with the sphere's arc in them, and what is weak about one."""

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib_core.captures.advice import USEFUL_ZONE, advise
from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray
from calib_core.records import Cell
from calib_core.sphere.arc import ArcFit
from server.sources.device import Frame

Profiler = Callable[[Frame], FloatArray]
"""Returns the points (N, 2), x and z in L, mm, of an exposure; raises CalibrationError."""


@dataclass(frozen=True, eq=False)
class Exposure:
    """One exposure, its profile (N, 2), and the arc in it or why there is none; `weak` is what to do better."""

    frame: Frame
    points: FloatArray
    arc: ArcFit | None
    problem: str = ""
    weak: str = ""
    zone: float | None = None


def exposure_of(frame: Frame, cell: Cell, profiler: Profiler) -> Exposure:
    """Return an exposure as it is looked at."""
    from calib_core.sphere.arc import fit_arc

    points: FloatArray = np.empty((0, 2))
    try:
        points = profiler(frame)
        arc = fit_arc(points, cell.sphere_diameter_mm, cell.scanner.z_axis)
    except CalibrationError as error:
        return Exposure(frame, points, None, f"Need {error.need}, got {error.got}. {error.to_do}")
    diameter_mm = cell.sphere_diameter_mm
    if not diameter_mm:
        return Exposure(frame, points, arc)
    weak = advise(arc, points, diameter_mm)
    return Exposure(frame, points, arc, "", " ".join(weak) if weak else "", 2 * arc.radius_mm / diameter_mm)


def in_short(exposure: Exposure) -> tuple[str, str]:
    """Return what is weak about an exposure and what to do, in a few words for a robot's panel."""
    along = re.search(r"(\d+) mm to ([−+])x", exposure.weak)
    step = re.search(r"(\d+) mm", exposure.weak)
    by = f"move {step.group(1)} mm " if step else "move "
    if exposure.zone is not None and exposure.zone > USEFUL_ZONE[1]:
        return "stripe through the middle of the sphere", f"{by}across the stripe"
    if exposure.zone is not None and exposure.zone < USEFUL_ZONE[0]:
        return "stripe grazes the sphere", f"{by}across the stripe to its middle"
    if along is not None:
        return "arc too short", f"move {along.group(1)} mm to {'+' if along.group(2) == '+' else '-'}x"
    return "arc too short", "bring the whole sphere into view"


def profile_of(frame: Frame) -> FloatArray:
    """Return the points of an exposure that is a profile's file; raises CalibrationError."""
    from calib_core.formats.points import parse_profile

    return parse_profile(frame.content, frame.name)
