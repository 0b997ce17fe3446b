"""The offset between two devices' clocks, from a move back and forth while the stripe sees the sphere."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from calib_core.errors import MeasurementError, MotionError
from calib_core.frames import FloatArray
from calib_core.messages import message

_LEAST_WAY_MM = 4.0
_LEAST_EXPOSURES = 20
_STEP_S = 0.004


@dataclass(frozen=True)
class ClockOffset:
    """How much more the scanner's clock tells than the robot's.

    Attributes
    ----------
    offset_s : float
        To be taken from the scanner's times.
    sigma_s : float
        Its standard deviation.
    rms_mm : float
        What remains between arcs and poses.
    exposures : int
        That were used.
    """

    offset_s: float
    sigma_s: float
    rms_mm: float
    exposures: int

    def shift_mm(self, speed_mm_s: float) -> float:
        """Return what the offset's standard deviation makes of a pose at a speed."""
        return self.sigma_s * speed_mm_s


def clock_offset(
    robot_times_s: ArrayLike,
    positions_mm: ArrayLike,
    scanner_times_s: ArrayLike,
    arcs: ArrayLike,
    largest_s: float = 0.5,
) -> ClockOffset:
    """Return the offset at which the arcs are a smooth function of where the robot was.

    Neither tool nor sphere need be known: with the orientation held, the circle's x, z and radius are functions of
    the way s along the move alone, here a cubic.  At an offset δ, s is taken from the robot's track at
    t − δ, and the coefficients by linear least squares (variable projection; Golub and Pereyra 1973); δ is where
    the rest is least.  With C the sum of squares at its least, n measurements and C″ its curvature,
    var δ = 2 C / (n − p) / C″.

    Parameters
    ----------
    robot_times_s : (K,)
    positions_mm : (K, 3)
        Of the flange in the base.
    scanner_times_s : (N,)
        By the scanner's clock.
    arcs : (N, 3)
        The circle's centre x, z and its radius, mm.
    largest_s : float
        Offsets are looked for within plus or minus this.

    Raises
    ------
    MotionError
        If the robot did not move back and forth.
    MeasurementError
        If too few exposures lie within the track, or the offset is at the end of what was looked for.
    """
    from scipy.interpolate import CubicSpline
    from scipy.optimize import minimize_scalar

    order = np.argsort(np.asarray(robot_times_s, dtype=float))
    at_s = np.asarray(robot_times_s, dtype=float)[order]
    positions = np.asarray(positions_mm, dtype=float)[order]
    kept = np.concatenate([[True], np.diff(at_s) > 1e-6])
    at_s, way_mm = at_s[kept], _way(positions[kept])
    seen_s, measured = np.asarray(scanner_times_s, dtype=float), np.asarray(arcs, dtype=float)
    inside = (seen_s > at_s[0] + largest_s) & (seen_s < at_s[-1] - largest_s)
    if inside.sum() < _LEAST_EXPOSURES:
        got = message(
            "{inside} that lie within the robot's track by {largest_s:g} s",
            inside=int(inside.sum()),
            largest_s=largest_s,
        )
        need = "{least_exposures} exposures with the sphere"
        to_do = "Move back and forth for longer, the sphere in view."
        raise MeasurementError(need, got, to_do, least_exposures=_LEAST_EXPOSURES)
    seen_s, measured = seen_s[inside], measured[inside]
    track = CubicSpline(at_s, way_mm)

    def rest(offset_s: float) -> float:
        s = track(seen_s - offset_s)
        basis = np.column_stack([np.ones_like(s), s, s**2, s**3])
        return float(np.sum((measured - basis @ np.linalg.lstsq(basis, measured, rcond=None)[0]) ** 2))

    grid = np.arange(-largest_s, largest_s + _STEP_S / 2, _STEP_S)
    best = int(np.argmin([rest(float(offset)) for offset in grid]))
    if best in (0, len(grid) - 1):
        to_do = message("Move faster and over 30 mm, or set the devices' clocks.")
        raise MeasurementError("an offset within ±{largest_s:g} s", "one at its end", to_do, largest_s=largest_s)
    found: Any = minimize_scalar(
        rest, bounds=(grid[best - 1], grid[best + 1]), method="bounded", options={"xatol": 1e-7}
    )
    offset_s, least = float(found.x), float(found.fun)
    curvature = (rest(offset_s + _STEP_S / 2) - 2 * least + rest(offset_s - _STEP_S / 2)) / (_STEP_S / 2) ** 2
    freedom = measured.size - 13
    sigma_s = float(np.sqrt(2 * least / freedom / max(curvature, 1e-300)))
    return ClockOffset(offset_s, sigma_s, float(np.sqrt(least / freedom)), len(seen_s))


def _way(positions_mm: FloatArray) -> FloatArray:
    """Return how far along its main direction the robot was, (K,)."""
    away = positions_mm - positions_mm.mean(axis=0)
    way: FloatArray = away @ np.linalg.svd(away, full_matrices=False)[2][0]
    if np.ptp(way) < _LEAST_WAY_MM:
        got = message("{way:.1f} mm", way=np.ptp(way))
        to_do = "Move back and forth for longer, the sphere in view."
        raise MotionError("a move over at least {least_way_mm:g} mm", got, to_do, least_way_mm=_LEAST_WAY_MM)
    middle = way - (way.max() + way.min()) / 2
    if np.count_nonzero(np.diff(np.sign(middle[np.abs(middle) > np.ptp(way) / 4]))) < 2:
        raise MotionError("a move back and forth", "one way alone", "Go there and back at least twice.")
    return way
