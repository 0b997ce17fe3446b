"""A result as text for a person: numbers with unit and uncertainty, evidence, and a verdict."""

import math
from collections.abc import Iterator

import numpy as np

from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.frames import RigidTransform
from calib_core.records import Session, TcpResult
from calib_core.robots import CONVENTIONS

_SIGMAS_OF_95 = 1.96


def tcp_summary(session: Session, result: TcpResult) -> str:
    """Return the scanner's pose on the flange in the session's own convention, and how we know."""
    used = sum(row.used for row in result.residuals)
    counts = f"{used} of {len(result.residuals)} captures used"
    lines = [
        f"tcp: {result.verdict.upper()}  ({session.name or 'session'}; {counts})",
        "",
        f"Scanner on the flange, as {result_convention(session)} (± 95 %)",
        *(f"  {line}" for line in frame_lines(session.cell.pose_convention, result)),
        "",
        *_evidence(result),
        *_two_step(result),
        *(f"Not used  {row.capture}: {row.reason}" for row in result.residuals if not row.used),
        *(f"Warning   {warning}" for warning in result.warnings),
    ]
    return "\n".join(lines)


def result_convention(session: Session) -> str:
    """Return the session's convention with its numbers' units."""
    convention = CONVENTIONS[session.cell.pose_convention]
    return f"{convention.name}, {convention.units}"


def frame_lines(name: str, result: TcpResult) -> Iterator[str]:
    """Give one line a number of the tool frame in a convention: ``x   140.32 ± 0.08 mm``."""
    convention = CONVENTIONS[name]
    tool = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    covariance = np.array(result.covariance, dtype=float)[:6, :6]
    if convention.form == "matrix":
        for row in result.tool0_from_laser:
            yield " ".join(f"{value:12.6f}" for value in row)
        return
    numbers, sigmas = tool_numbers(name, tool), tool_number_sigmas(name, tool, covariance)
    for label, value, sigma in zip(convention.numbers.split(), numbers, sigmas, strict=True):
        yield f"{label:3} {with_uncertainty(value, _SIGMAS_OF_95 * sigma)}"


def with_uncertainty(value: float, uncertainty: float) -> str:
    """Return a value with as many digits as its uncertainty allows: the uncertainty keeps two."""
    if not (math.isfinite(uncertainty) and uncertainty > 0):
        return f"{value:10.4f}"
    decimals = min(max(1 - math.floor(math.log10(uncertainty)), 0), 9)
    return f"{value:12.{decimals}f} ± {uncertainty:.{decimals}f}"


def _evidence(result: TcpResult) -> Iterator[str]:
    x, y, z = result.sphere_center_in_base_mm
    parts = result.variance_components
    estimated = f" (estimated: {', '.join(parts.estimated)})" if parts.estimated else " (given)"
    yield f"Sphere    centre in base {x:.3f} {y:.3f} {z:.3f} mm"
    yield (
        f"Noise     points {parts.point_sigma_mm:.4f} mm, robot {parts.position_sigma_mm:.3f} mm and "
        f"{parts.orientation_sigma_deg:.4f}°{estimated}"
    )


def _two_step(result: TcpResult) -> Iterator[str]:
    """Give the joint answer's figures and, beside them, those of the paper's two steps."""
    two = result.two_step
    if two.tool0_from_laser is None:
        scatter, surface = _mm(result.center_scatter_rms_mm), _mm(result.surface_rms_mm)
        yield f"Fit       scatter of centres {scatter}, surface {surface}"
        yield f"Two-step  no answer: {two.reason or 'not enough pure translations'}"
        return
    joint = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    difference = joint.difference(RigidTransform.from_rounded(two.tool0_from_laser, "tool0", "laser"))
    rows = [
        ("scatter of centres", result.center_scatter_rms_mm, two.center_scatter_rms_mm),
        ("surface", result.surface_rms_mm, two.surface_rms_mm),
        ("surface, leave one out", result.leave_one_out_surface_rms_mm, two.leave_one_out_surface_rms_mm),
    ]
    yield f"{'RMS':34}{'joint':>12}{'two-step':>12}"
    for label, ours, theirs in rows:
        yield f"  {label:32}{_mm(ours):>12}{_mm(theirs):>12}"
    angle_deg, shift_mm = np.rad2deg(np.linalg.norm(difference[:3])), np.linalg.norm(difference[3:])
    yield f"  the two answers differ by {angle_deg:.3f}° and {shift_mm:.3f} mm"


def _mm(value: float | None) -> str:
    return "—" if value is None or not math.isfinite(value) else f"{value:.3f} mm"
