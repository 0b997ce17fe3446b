"""Numbers as a report shows them: with unit, uncertainty, and no more digits than that allows."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from calib_core.errors import InputError
from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.frames import FloatArray, RigidTransform
from calib_core.robots import CONVENTIONS

COVERAGE: Final = 2.0
"""The factor k between standard and expanded uncertainty: about 95 %."""


_LARGEST: Final = 1e9
_ROUNDING: Final = 1e-15


def number(value: float | None, decimals: int = 3, unit: str = "") -> str:
    """Return a number with fixed decimals and its unit, a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    space = "" if unit in ("", "°") else "\u202f"
    return f"{round(value, decimals) + 0.0:.{decimals}f}{space}{unit}".replace("-", "−")  # + 0.0: no minus zero


def with_decimals_of(value: float, uncertainty: float) -> tuple[str, str]:
    """Return a value and its uncertainty with as many decimals as leave the uncertainty two digits."""
    if not (math.isfinite(uncertainty) and uncertainty > 0):
        return number(value, 4), "–"
    decimals = min(max(1 - math.floor(math.log10(uncertainty)), 0), 9)
    return number(value, decimals), number(uncertainty, decimals)


def pose_covariance(rows: Sequence[Sequence[float]], where: str) -> FloatArray:
    """Return the covariance (6, 6) of a pose out of a stored result; raises InputError where it is none."""
    square = len(rows) >= 6 and all(len(row) >= 6 for row in rows[:6])
    covariance = np.array([row[:6] for row in rows[:6]]) if square else np.full((6, 6), np.nan)
    if not (np.abs(covariance) < _LARGEST).all() or np.linalg.eigvalsh(covariance)[0] < -_ROUNDING * _LARGEST:
        got = "numbers that are none" if square else "another shape"
        raise InputError("a covariance of six numbers", got, "Solve the session again.", where)
    return covariance


def frame_rows(name: str, frame: RigidTransform, covariance: FloatArray) -> list[tuple[str, str, str]]:
    """Return label, value and expanded uncertainty of each number that the controller is given of a frame.

    `covariance` (6, 6) is of rx ry rz tx ty tz, the rotation perturbing on the right.  A matrix has no such rows.
    """
    convention = CONVENTIONS[name]
    if convention.form == "matrix":
        return []
    sigmas = tool_number_sigmas(name, frame, covariance)
    rows: list[tuple[str, str, str]] = []
    for label, value, sigma in zip(convention.numbers.split(), tool_numbers(name, frame), sigmas, strict=True):
        rows.append((label, *with_decimals_of(value, COVERAGE * sigma)))
    return rows
