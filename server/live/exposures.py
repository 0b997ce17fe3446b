"""Exposures of the scanner as points with the sphere's arc in them, and what is weak about one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib_core.captures.advice import arc_findings
from calib_core.errors import CalibrationError
from calib_core.findings import Finding, has
from calib_core.findings.codes.quality import STRIPE_GRAZES, STRIPE_IN_MIDDLE
from calib_core.formats.points import usual_kind
from calib_core.frames import FloatArray
from calib_core.messages import message, sentences
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Cell
from calib_core.sphere.arc import ArcFit
from server.live.pictures import Picture, picture_of, pixels_of_arc, profile_in
from server.sources.device import Frame

Optics = Callable[[], ProfileCalibration]
"""Returns what turns a camera's stripe into points; raises CalibrationError where that is not known yet."""


@dataclass(frozen=True, eq=False)
class Exposure:
    """One exposure, its profile (N, 2), and the arc in it or why there is none; `weak` is what to do better.

    `picture` is the image that a camera sent, `arc_px` (N, 2) where the arc's circle lies in it.
    """

    frame: Frame
    points: FloatArray
    arc: ArcFit | None
    problem: str = ""
    weak: Finding | None = None
    zone: float | None = None
    picture: Picture | None = None
    arc_px: FloatArray | None = None


def exposure_of(frame: Frame, cell: Cell, optics: Optics) -> Exposure:
    """Return an exposure as it is looked at."""
    from calib_core.sphere.arc import fit_arc

    points: FloatArray = np.empty((0, 2))
    picture, calibration = None, None
    try:
        if usual_kind(frame.name) == "frame":
            picture = picture_of(frame)
            calibration = optics()
            points = profile_in(picture, calibration)
        else:
            points = profile_of(frame)
        arc = fit_arc(points, cell.sphere_diameter_mm, cell.scanner.z_axis)
    except CalibrationError as error:
        problem = sentences([message("Need {need}, got {got}.", need=error.need, got=error.got), error.to_do])
        return Exposure(frame, points, None, problem, picture=picture)
    arc_px = None if calibration is None else pixels_of_arc(arc.center_mm, arc.radius_mm, calibration)
    diameter_mm = cell.sphere_diameter_mm
    weak = arc_findings(arc, points, diameter_mm) if diameter_mm else []
    zone = 2 * arc.radius_mm / diameter_mm if diameter_mm else None
    return Exposure(frame, points, arc, "", weak[0] if weak else None, zone, picture, arc_px)


def in_short(weak: Finding) -> tuple[str, str]:
    """Return what is weak about an exposure and what to do, in a few words for a robot's panel."""
    told = weak.values
    if has([weak], STRIPE_IN_MIDDLE):
        return "stripe through the middle of the sphere", message(
            "move {move_mm:.0f} mm across the stripe", move_mm=told["step_mm"]
        )
    if has([weak], STRIPE_GRAZES):
        return "stripe grazes the sphere", message(
            "move {move_mm:.0f} mm across the stripe to its middle", move_mm=told["step_mm"]
        )
    if told["end"] == "covered":
        return "arc too short", "bring the whole sphere into view"
    way = "-" if told["end"] == "minus" else "+"
    return "arc too short", message("move {move_mm:.0f} mm to {way}x", move_mm=told["move_mm"], way=way)


def profile_of(frame: Frame) -> FloatArray:
    """Return the points of an exposure that is a profile's file; raises CalibrationError."""
    from calib_core.formats.points import parse_profile

    return parse_profile(frame.content, frame.name)
