"""Camera and plane of light as text for a person: numbers with unit and uncertainty, evidence, and a verdict."""

import math

from calib_core.records import CameraResult, LaserPlaneResult, Result
from server.render.text.summary import with_uncertainty

_SIGMAS_OF_95 = 1.96


def camera_summary(result: CameraResult) -> str:
    """Return the camera's parameters with their 95 % uncertainty, and how we know."""
    lines = [_headline("camera", result), "", f"Model     {result.model} (± 95 %)"]
    values = _parameters(result)
    for index, name in enumerate(result.parameters):
        sigma = math.sqrt(max(result.covariance[index][index], 0.0))
        if name in values:
            lines.append(f"  {name:6} {with_uncertainty(values[name], _SIGMAS_OF_95 * sigma)}")
    lines.append(f"Fit       RMS {result.reprojection_rms_px:.3f} px")
    if result.tilt_correlation is not None:
        lines.append(f"Tilt      correlation with the principal point {result.tilt_correlation:+.2f}")
    return "\n".join([*lines, *_remarks(result)])


def laser_plane_summary(result: LaserPlaneResult) -> str:
    """Return the plane of light in the camera frame with its uncertainty, and how we know."""
    x, y, z = result.plane_in_camera.normal
    turn_deg = _SIGMAS_OF_95 * result.normal_sigma_deg
    distance = with_uncertainty(result.plane_in_camera.distance_mm, _SIGMAS_OF_95 * result.distance_sigma_mm)
    lines = [
        _headline("laser-plane", result),
        "",
        f"Normal    ({x:.5f}, {y:.5f}, {z:.5f}) in the camera's frame ± {turn_deg:.2g}° (95 %)",
        f"Distance  {distance.strip()} mm from the camera (95 %)",
        f"Fit       RMS {result.plane_rms_mm:.3f} mm",
    ]
    return "\n".join([*lines, *_remarks(result)])


def _headline(stage: str, result: CameraResult | LaserPlaneResult) -> str:
    used = sum(row.used for row in result.residuals)
    return f"{stage}: {result.verdict.upper()}  ({used} of {len(result.residuals)} captures used)"


def _parameters(result: CameraResult) -> dict[str, float]:
    matrix = result.camera_matrix
    return {"fx": matrix[0][0], "fy": matrix[1][1], "cx": matrix[0][2], "cy": matrix[1][2], **result.distortion}


def _remarks(result: Result) -> list[str]:
    return [f"Warning   {warning}" for warning in result.warnings]
