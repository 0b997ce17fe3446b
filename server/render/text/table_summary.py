"""A turntable's result, or the whole chain's, as text for a person."""

from collections.abc import Iterator

import numpy as np

from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.frames import RigidTransform
from calib_core.records import ChainResult, Session, TurntableResult
from calib_core.robots import CONVENTIONS
from server.render.text.summary import with_uncertainty

_SIGMAS_OF_95 = 1.96


def table_summary(session: Session, result: TurntableResult | ChainResult) -> str:
    """Return the table's axis and frame, and for the whole chain its tool, with uncertainties and doubts."""
    used = sum(row.used for row in result.residuals)
    counts = f"{used} of {len(result.residuals)} captures used"
    lines = [
        f"{result.stage}: {result.verdict.upper()}  ({session.name or 'session'}; {counts})",
        "",
        *_axis(result),
        *(_tool(session, result) if isinstance(result, ChainResult) else ()),
        *_evidence(result),
        *(f"Not used  {row.capture}: {row.reason}" for row in result.residuals if not row.used),
        *(f"Warning   {warning}" for warning in result.warnings),
    ]
    return "\n".join(lines)


def _axis(result: TurntableResult | ChainResult) -> Iterator[str]:
    x, y, z = result.axis_direction_in_base
    yield f"Axis      ({x:.6f}, {y:.6f}, {z:.6f}) in base ± {1.96 * result.axis_direction_sigma_deg:.4f}° (95 %)"
    sigmas = np.sqrt(np.diag(np.array(result.axis_point_covariance)))
    point = [
        with_uncertainty(value, _SIGMAS_OF_95 * float(sigma)).strip()
        for value, sigma in zip(result.axis_point_in_base_mm, sigmas, strict=True)
    ]
    yield f"Point     {', '.join(point)} mm: the centre of the first mounting's circle, T's origin"
    hand = "right" if result.direction > 0 else "left"
    yield f"Turns     {hand}-handed about this axis (direction {result.direction})"
    for mount in result.mounts:
        a, b, c = mount.center_in_turntable_mm
        name = mount.mount or "(no name)"
        yield f"Sphere    {name}: {a:.3f} {b:.3f} {c:.3f} mm in T, {mount.radius_mm:.3f} mm off the axis"


def _tool(session: Session, result: ChainResult) -> Iterator[str]:
    name = session.cell.pose_convention
    convention = CONVENTIONS[name]
    tool = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    yield f"Scanner on the flange, as {convention.name}, {convention.units} (± 95 %)"
    if convention.form == "matrix":
        yield from ("  " + " ".join(f"{value:12.6f}" for value in row) for row in result.tool0_from_laser)
        return
    sigmas = tool_number_sigmas(name, tool, np.array(result.covariance))
    for label, value, sigma in zip(convention.numbers.split(), tool_numbers(name, tool), sigmas, strict=True):
        yield f"  {label:3} {with_uncertainty(value, _SIGMAS_OF_95 * sigma)}"


def _evidence(result: TurntableResult | ChainResult) -> Iterator[str]:
    yield (
        f"Fit       RMS away from the axis {result.radial_rms_mm:.3f} mm, along it {result.axial_rms_mm:.3f} mm, "
        f"around it {result.angle_rms_deg:.4f}°"
    )
    parts = result.variance_components
    estimated = f" (estimated: {', '.join(parts.estimated)})" if parts.estimated else " (given)"
    yield (
        f"Noise     robot {parts.position_sigma_mm:.3f} mm and {parts.orientation_sigma_deg:.4f}°, "
        f"table {result.angle_sigma_deg:.4f}°{estimated}"
    )
    if result.circles_axis_direction_in_base is not None:
        cross = np.cross(result.axis_direction_in_base, result.circles_axis_direction_in_base)
        angle_deg = float(np.rad2deg(np.linalg.norm(cross)))
        yield f"Circles   the paper's axis differs by {angle_deg:.4f}°"
