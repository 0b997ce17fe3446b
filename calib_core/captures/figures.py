"""What a capture's record says it shows: the figures of the sphere in its points."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.captures.content import thinned, thinning
from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit
from calib_core.sphere.cloud import SphereFit


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
