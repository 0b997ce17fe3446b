"""What is wrong when the measured sphere and the stated diameter disagree: units, radius, or another sphere."""

import numpy as np
from numpy.typing import ArrayLike

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import message, templates

SMALLEST_CIRCLE = 0.1
"""Smallest circle, as a share of the sphere's radius, that a profile is taken to cut from the sphere."""

_WANTED = templates(
    {
        "arc": "an arc of radius ≤ {stated_mm:g} mm (sphere diameter {diameter_mm:g} mm)",
        "sphere": "a sphere of radius {stated_mm:g} mm (sphere diameter {diameter_mm:g} mm)",
    }
)
_FOUND = templates(
    {"arc": "an arc of radius {radius_mm:.6g} mm", "sphere": "a sphere of radius {radius_mm:.6g} mm"}
)
_CLEARLY_LARGER = 1.2  # nearer than that, a diameter that is a few per cent off is likelier than one halved


def points_as_rows(points: ArrayLike, columns: int, what: str) -> FloatArray:
    """Return points as a float array (N, columns).

    Raises
    ------
    MeasurementError
        If there is no point, or the array has another shape.
    """
    array = np.asarray(points, dtype=float)
    if array.size == 0:
        to_do = "Check the scanner's exposure and its file."
        raise MeasurementError("a {kind} with points", "an empty one", to_do, kind=what)
    if array.ndim != 2 or array.shape[1] != columns:
        need = "a {what} as an array of N rows and {columns} columns"
        to_do = "Write one point a line."
        raise MeasurementError(
            need, "an array of shape {shape}", to_do, what=what, columns=columns, shape=array.shape
        )
    return array


def require_diameter(diameter_mm: float | None) -> None:
    """Raise MeasurementError unless the diameter is None or a positive finite number."""
    if diameter_mm is not None and not (np.isfinite(diameter_mm) and diameter_mm > 0):
        to_do = "Give the diameter from the sphere's certificate."
        raise MeasurementError("a positive diameter in mm", f"{diameter_mm}", to_do)


def radius_mismatch(radius_mm: float, diameter_mm: float, shape: str) -> MeasurementError:
    """Return the error that names the likeliest reason why a clear `shape` has a radius that cannot be.

    Parameters
    ----------
    radius_mm : float
        Radius of the arc (of any circle on the sphere) or of the sphere that was found.
    diameter_mm : float
        The sphere's diameter as it was stated.
    shape : str
        "arc" or "sphere".
    """
    stated_mm = diameter_mm / 2
    need = message(_WANTED[shape], stated_mm=stated_mm, diameter_mm=diameter_mm)
    got = message(_FOUND[shape], radius_mm=radius_mm)
    if _explains(radius_mm / 1000, stated_mm, shape):
        if diameter_mm < 1:
            to_do = message(
                "The diameter looks like metres: give it in mm, {diameter_mm:g}.", diameter_mm=diameter_mm * 1000
            )
        else:
            to_do = message("The points look like micrometres: give them in mm.")
        return MeasurementError(need, got, to_do)
    if _explains(radius_mm * 1000, stated_mm, shape):
        to_do = "The points look like metres: give them in mm (multiply by 1000, or state the unit m)."
        return MeasurementError(need, got, to_do)
    if radius_mm > _CLEARLY_LARGER * stated_mm and _explains(radius_mm, diameter_mm, shape):
        return MeasurementError(
            need,
            got,
            "The diameter may be the sphere's radius: if the sphere is {diameter_mm:g} mm wide, give that. "
            "The sphere measured is larger than stated.",
            diameter_mm=2 * diameter_mm,
        )
    to_do = message(
        "The sphere measured is larger than stated: correct the diameter, or keep other round things away."
    )
    if radius_mm < stated_mm:
        to_do = message(
            "The sphere measured is smaller than stated: correct the diameter, or keep other round things away."
        )
    return MeasurementError(need, got, to_do)


def _explains(radius_mm: float, stated_mm: float, shape: str) -> bool:
    """Whether a radius fits a sphere: any circle on it for an arc, its own radius for a sphere."""
    least = SMALLEST_CIRCLE if shape == "arc" else 0.9
    most = 1.02 if shape == "arc" else 1.1
    return least * stated_mm <= radius_mm <= most * stated_mm
