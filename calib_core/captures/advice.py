"""What to do better at the next profile of the sphere: where the stripe should lie on it."""

import numpy as np

from calib_core.findings import Finding
from calib_core.findings.codes import quality as codes
from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit

USEFUL_ZONE = (0.45, 0.95)
"""r/R between which a profile says where the sphere's centre is: beyond, y = ±√(R² − r²) is badly known."""

_BEST_ZONE = 0.75
_ENOUGH_EXTENT_RAD = np.deg2rad(70.0)
_WANTED_HALF_EXTENT_RAD = np.deg2rad(55.0)
_AT_THE_END = 0.05  # of the radius: this near to the stripe's end, the end has cut the arc


def arc_findings(fit: ArcFit, points_mm: FloatArray, sphere_diameter_mm: float) -> list[Finding]:
    """Return what is weak about a profile and what to do about it: one finding, none where it is good.

    Parameters
    ----------
    fit : ArcFit
    points_mm : (N, 2)
        The whole profile, x and z in L.
    sphere_diameter_mm : float
    """
    return _zone(fit, sphere_diameter_mm) or _extent(fit, points_mm)


def _zone(fit: ArcFit, sphere_diameter_mm: float) -> list[Finding]:
    radius_mm = sphere_diameter_mm / 2
    zone = fit.radius_mm / radius_mm
    offset_mm = radius_mm * float(np.sqrt(max(1 - zone**2, 0.0)))
    step_mm = abs(radius_mm * float(np.sqrt(1 - _BEST_ZONE**2)) - offset_mm)
    if USEFUL_ZONE[0] <= zone <= USEFUL_ZONE[1]:
        return []
    code = codes.STRIPE_IN_MIDDLE if zone > USEFUL_ZONE[1] else codes.STRIPE_GRAZES
    return [code(zone=zone, step_mm=step_mm)]


def _extent(fit: ArcFit, points_mm: FloatArray) -> list[Finding]:
    if fit.extent_rad >= _ENOUGH_EXTENT_RAD:
        return []
    x_mm, arc_x_mm = points_mm[:, 0], points_mm[fit.inliers, 0]
    room_mm = fit.radius_mm * float(np.sin(_WANTED_HALF_EXTENT_RAD))
    below_mm = room_mm - float(fit.center_mm[0] - arc_x_mm.min())
    above_mm = room_mm - float(arc_x_mm.max() - fit.center_mm[0])
    end_mm = _AT_THE_END * fit.radius_mm
    end, move_mm = "covered", 0.0
    if arc_x_mm.min() - x_mm.min() < end_mm and below_mm > above_mm:
        end, move_mm = "minus", below_mm
    elif x_mm.max() - arc_x_mm.max() < end_mm and above_mm > below_mm:
        end, move_mm = "plus", above_mm
    return [codes.ARC_SHORT(extent_deg=float(np.rad2deg(fit.extent_rad)), end=end, move_mm=move_mm)]
