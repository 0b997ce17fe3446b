"""Which directions of the TCP the motions do not fix, and what to move so that they do."""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray

_TRANSLATION_LIMIT_MM = 5.0
_ROTATION_LIMIT_RAD = np.deg2rad(2.0)


@dataclass(frozen=True, eq=False)
class OpenDirection:
    """A direction of the answer that is not determined.

    Attributes
    ----------
    direction : (6,)
        Unit vector rx ry rz tx ty tz.
    sigma : float
        Its standard deviation, rad or mm.
    description : str
        What it is and which motion fixes it.
    """

    direction: FloatArray
    sigma: float
    description: str


def open_directions(covariance: FloatArray, tolerance: float = 1.0) -> list[OpenDirection]:
    """Return the directions whose standard deviation exceeds 5 mm or 2°, times `tolerance`.

    Parameters
    ----------
    covariance : (6, 6)
        Of tool0_from_laser.
    tolerance : float
        Smaller values find the weakly determined directions too.
    """
    found: list[OpenDirection] = []
    values, vectors = np.linalg.eigh(covariance[:3, :3])
    for value, axis in zip(values, vectors.T, strict=True):
        sigma = float(np.sqrt(max(value, 0.0)))
        if sigma > _ROTATION_LIMIT_RAD * tolerance:
            found.append(
                OpenDirection(
                    np.concatenate([_signed(axis), np.zeros(3)]),
                    sigma,
                    f"the scanner's rotation about {_axis_name(axis, 'laser')} (±{_degrees(2 * sigma)}): "
                    "move the scanner sideways and towards the sphere without turning it",
                )
            )
    values, vectors = np.linalg.eigh(covariance[3:, 3:])
    for value, axis in zip(values, vectors.T, strict=True):
        sigma = float(np.sqrt(max(value, 0.0)))
        if sigma > _TRANSLATION_LIMIT_MM * tolerance:
            found.append(
                OpenDirection(
                    np.concatenate([np.zeros(3), _signed(axis)]),
                    sigma,
                    f"the scanner's position along {_axis_name(axis, 'flange')} (±{_millimetres(2 * sigma)}): "
                    f"no sufficient rotation about an axis across it yet; tilt the flange about {_across(axis)}",
                )
            )
    return found


def _degrees(angle_rad: float) -> str:
    return "90° or more" if angle_rad > np.pi / 2 else f"{np.rad2deg(angle_rad):.1f}°"


def _millimetres(length_mm: float) -> str:
    return "more than a metre" if length_mm > 1000 else f"{length_mm:.0f} mm"


def _signed(axis: FloatArray) -> FloatArray:
    return axis * np.sign(axis[np.argmax(np.abs(axis))])


def _axis_name(axis: FloatArray, frame: str) -> str:
    largest = int(np.argmax(np.abs(axis)))
    if abs(axis[largest]) > np.cos(np.deg2rad(20)):
        return f"{frame} {'xyz'[largest]}"
    signed = _signed(axis)
    return f"{frame} ({signed[0]:.2f}, {signed[1]:.2f}, {signed[2]:.2f})"


def _across(axis: FloatArray) -> str:
    names = ["its " + "xyz"[i] + " axis" for i in np.argsort(np.abs(axis))[:2]]
    return " or ".join(sorted(names))
