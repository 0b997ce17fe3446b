"""What was measured in a capture, made of what was noticed in it."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.captures.content import thinned, thinning
from calib_core.errors import CalibrationError
from calib_core.findings import Finding, measured_judgement
from calib_core.findings.codes.quality import NOT_SEEN
from calib_core.frames import FloatArray
from calib_core.records import Capture, Measured
from calib_core.sphere.arc import ArcFit
from calib_core.sphere.cloud import SphereFit


def not_seen(capture: Capture, error: CalibrationError, **more: Any) -> Measured:
    """Return why a capture does not show what it is to show, and what to do."""
    found = NOT_SEEN([capture.id], need=error.need, got=error.got, to_do=error.to_do)
    return measured_of(capture, [found], **more)


def measured_of(capture: Capture, findings: Iterable[Finding], **figures: Any) -> Measured:
    """Return what was measured in a capture: what was noticed, and the figures by the fields of `Measured`."""
    return Measured(capture=capture.id, kind=capture.kind, **measured_judgement(findings), **figures)


def figures_of(
    fit: ArcFit | SphereFit, points: FloatArray, on_sphere: NDArray[np.bool_], diameter_mm: float | None
) -> dict[str, Any]:
    """Return the figures and the drawing of a sphere of a diameter in points, by the fields of `Measured`."""
    figures: dict[str, Any] = {
        "center_mm": fit.center_mm.tolist(),
        "radius_mm": fit.radius_mm,
        "rms_mm": fit.rms_mm,
        "point_sigma_mm": fit.point_sigma_mm,
        "covariance": fit.covariance.tolist(),
        "preview": thinned(points),
        "preview_on_sphere": on_sphere[thinning(len(points))].tolist(),
    }
    if isinstance(fit, ArcFit):
        assert diameter_mm is not None
        figures["zone"] = 2 * fit.radius_mm / diameter_mm
        figures["extent_deg"] = float(np.rad2deg(fit.extent_rad))
    return figures
