"""Which directions of the TCP the motions do not fix, and what to move so that they do."""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import Message, message

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
    axis : str
        Along or about what: "x", or a direction in the frame.
    across : str
        Of a translation, the axes of what carries the scanner about which the flange should be tilted.
    """

    direction: FloatArray
    sigma: float
    axis: str
    across: str = ""

    @property
    def is_rotation(self) -> bool:
        """Whether it is a rotation of the scanner, about an axis of the laser; else a shift on what carries it."""
        return bool(np.any(self.direction[:3]))

    @property
    def told(self) -> str:
        """Its axis, with how far it is open (k = 2)."""
        if np.isinf(self.sigma):
            return self.axis
        return f"{self.axis} (±{_degrees(2 * self.sigma) if self.is_rotation else _millimetres(2 * self.sigma)})"

    @property
    def description(self) -> Message:
        """What it is and which motion fixes it."""
        if self.is_rotation:
            return message(
                "the scanner's rotation about laser {axis}: move the flange so that the sphere is seen farther "
                "aside and at another distance, without turning it",
                axis=self.told,
            )
        return message(
            "the scanner's position along {axis} of what carries it: no sufficient rotation about an axis across "
            "it yet; tilt the flange about {across} of that frame, one of them at least",
            axis=self.told,
            across=self.across.split(", "),
        )


def open_directions(covariance: FloatArray, tolerance: float = 1.0) -> list[OpenDirection]:
    """Return the directions whose standard deviation exceeds 5 mm or 2°, times `tolerance`.

    Parameters
    ----------
    covariance : (6, 6)
        Of mount_from_laser.
    tolerance : float
        Smaller values find the weakly determined directions too.
    """
    found: list[OpenDirection] = []
    values, vectors = np.linalg.eigh(covariance[:3, :3])
    for value, axis in zip(values, vectors.T, strict=True):
        sigma = float(np.sqrt(max(value, 0.0)))
        if sigma > _ROTATION_LIMIT_RAD * tolerance:
            direction = np.concatenate([_signed(axis), np.zeros(3)])
            found.append(OpenDirection(direction, sigma, _axis_name(axis)))
    values, vectors = np.linalg.eigh(covariance[3:, 3:])
    for value, axis in zip(values, vectors.T, strict=True):
        sigma = float(np.sqrt(max(value, 0.0)))
        if sigma > _TRANSLATION_LIMIT_MM * tolerance:
            direction = np.concatenate([np.zeros(3), _signed(axis)])
            found.append(OpenDirection(direction, sigma, _axis_name(axis), _across(axis)))
    return found


def without_turns(directions: FloatArray) -> list[OpenDirection]:
    """Return directions (m, 3) of the position along which nothing is known, as nothing turned across them."""
    return [
        OpenDirection(np.concatenate([np.zeros(3), _signed(v)]), np.inf, _axis_name(v), _across(v))
        for v in directions
    ]


def about_travel(travel: FloatArray | None, carrier_from_laser: RigidTransform) -> list[OpenDirection]:
    """Return the rotation about the one line of travel (3,), of the frame of what carries the scanner."""
    if travel is None:
        return []
    axis = carrier_from_laser.rotation.T @ travel
    return [OpenDirection(np.concatenate([_signed(axis), np.zeros(3)]), np.inf, _axis_name(axis))]


def _degrees(angle_rad: float) -> str:
    return "≥ 90°" if angle_rad > np.pi / 2 else f"{np.rad2deg(angle_rad):.1f}°"


def _millimetres(length_mm: float) -> str:
    return "> 1 m" if length_mm > 1000 else f"{length_mm:.0f} mm"


def _signed(axis: FloatArray) -> FloatArray:
    return axis * np.sign(axis[np.argmax(np.abs(axis))])


def _axis_name(axis: FloatArray) -> str:
    largest = int(np.argmax(np.abs(axis)))
    if abs(axis[largest]) > np.cos(np.deg2rad(20)):
        return "xyz"[largest]
    signed = _signed(axis)
    return f"({signed[0]:.2f}, {signed[1]:.2f}, {signed[2]:.2f})"


def _across(axis: FloatArray) -> str:
    return ", ".join(sorted("xyz"[i] for i in np.argsort(np.abs(axis))[:2]))
