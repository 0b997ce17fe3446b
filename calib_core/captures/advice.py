"""What to do better at the next profile of the sphere: where the stripe should lie on it."""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit

USEFUL_ZONE = (0.45, 0.95)
"""r/R between which a profile says where the sphere's centre is: beyond, y = ±√(R² − r²) is badly known."""

_BEST_ZONE = 0.75
_ENOUGH_EXTENT_RAD = np.deg2rad(70.0)
_WANTED_HALF_EXTENT_RAD = np.deg2rad(55.0)
_AT_THE_END = 0.05  # of the radius: this near to the stripe's end, the end has cut the arc


def advise(fit: ArcFit, points_mm: FloatArray, sphere_diameter_mm: float) -> tuple[str, str] | None:
    """Return what is weak about a profile and what to do about it, or None where it is good.

    Parameters
    ----------
    fit : ArcFit
    points_mm : (N, 2)
        The whole profile, x and z in L.
    sphere_diameter_mm : float
    """
    return _zone(fit, sphere_diameter_mm) or _extent(fit, points_mm)


def _zone(fit: ArcFit, sphere_diameter_mm: float) -> tuple[str, str] | None:
    radius_mm = sphere_diameter_mm / 2
    zone = fit.radius_mm / radius_mm
    offset_mm = radius_mm * float(np.sqrt(max(1 - zone**2, 0.0)))
    step_mm = abs(radius_mm * float(np.sqrt(1 - _BEST_ZONE**2)) - offset_mm)
    if zone > USEFUL_ZONE[1]:
        return (
            f"The stripe runs almost through the sphere's middle (r/R = {zone:.3f}): "
            "the circle barely changes there when the sphere moves across the stripe.",
            f"Move the stripe about {step_mm:.0f} mm off the sphere's middle, square to the stripe.",
        )
    if zone < USEFUL_ZONE[0]:
        return (
            f"The stripe only grazes the sphere (r/R = {zone:.2f}).",
            f"Move the stripe about {step_mm:.0f} mm towards the sphere's middle, square to the stripe.",
        )
    return None


def _extent(fit: ArcFit, points_mm: FloatArray) -> tuple[str, str] | None:
    if fit.extent_rad >= _ENOUGH_EXTENT_RAD:
        return None
    reason = f"Only {np.rad2deg(fit.extent_rad):.0f}° of the arc are seen, 110° and more are good."
    x_mm, arc_x_mm = points_mm[:, 0], points_mm[fit.inliers, 0]
    room_mm = fit.radius_mm * float(np.sin(_WANTED_HALF_EXTENT_RAD))
    missing_below_mm = room_mm - float(fit.center_mm[0] - arc_x_mm.min())
    missing_above_mm = room_mm - float(arc_x_mm.max() - fit.center_mm[0])
    end_mm = _AT_THE_END * fit.radius_mm
    if arc_x_mm.min() - x_mm.min() < end_mm and missing_below_mm > missing_above_mm:
        return reason, f"The sphere leaves the stripe at its −x end: move {missing_below_mm:.0f} mm to −x."
    if x_mm.max() - arc_x_mm.max() < end_mm and missing_above_mm > missing_below_mm:
        return reason, f"The sphere leaves the stripe at its +x end: move {missing_above_mm:.0f} mm to +x."
    return reason, "Move the whole sphere into the measuring range, and keep other things out of its way."
