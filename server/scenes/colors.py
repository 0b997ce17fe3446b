"""Colours of the scene: residuals on a diverging scale with zero in the middle, one colour for each meaning."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

Rgb = tuple[int, int, int]

USED: Rgb = (86, 128, 180)
WAITING: Rgb = (140, 140, 145)
REJECTED: Rgb = (230, 159, 0)
STATE_COLOR: dict[str, Rgb] = {"used": USED, "rejected": REJECTED, "waiting": WAITING}
LIGHT: Rgb = (0, 158, 115)
SPHERE: Rgb = (150, 155, 165)
GHOST: Rgb = (190, 75, 200)
UNCERTAIN: Rgb = (213, 94, 0)
LASER: Rgb = (214, 39, 40)
FIRST: Rgb = (30, 110, 200)
SECOND: Rgb = (230, 120, 20)

MOUNTS: tuple[Rgb, ...] = ((204, 121, 167), (60, 160, 215), (200, 190, 60), (120, 90, 200))
BOARD: Rgb = (60, 160, 215)
# Twelve tones that neighbours in a row tell apart, as many as a table's scans, and viridis for heights.
SCANS: tuple[Rgb, ...] = (
    (86, 128, 180), (222, 143, 68), (86, 166, 120), (196, 92, 100),
    (140, 112, 186), (176, 160, 80), (70, 170, 180), (200, 120, 170),
    (30, 70, 120), (120, 80, 50), (20, 110, 70), (120, 30, 80),
)  # fmt: skip
GREYS: tuple[Rgb, ...] = ((25, 25, 28), (240, 240, 235))
VIRIDIS: tuple[Rgb, ...] = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))

# Blue – grey – red at even steps from −limit to +limit; grey stands out from a white and from a black ground.
DIVERGING: tuple[Rgb, ...] = ((20, 70, 190), (95, 145, 225), (172, 172, 172), (232, 125, 95), (190, 20, 35))

_ROBUST = 0.98
_FAINT = 0.65  # the grey's share where a colour steps back behind the picked capture's


def residual_limit_mm(residuals_mm: Sequence[FloatArray]) -> float:
    """Return the symmetric limit of the scale: the 98 % quantile of |residual|, rounded up.

    It is rounded to 1, 1.5, 2, 3, 5 or 7 · 10ⁿ mm, which keeps the colours as they are while captures come in one
    by one.  Without residuals it is 0.1 mm.
    """
    values = np.abs(np.concatenate([np.zeros(0), *residuals_mm]))
    quantile = float(np.quantile(values, _ROBUST)) if values.size else 0.1
    exponent = np.floor(np.log10(max(quantile, 1e-4)))
    steps = np.array([1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0]) * 10**exponent
    return float(np.round(steps[np.searchsorted(steps, quantile * (1 - 1e-9))], 9))


def diverging_colors(residuals_mm: FloatArray, limit_mm: float) -> NDArray[np.uint8]:
    """Return the colours (N, 3) of residuals (N,); beyond the limit the end colours stand."""
    return _between(residuals_mm, -limit_mm, limit_mm, DIVERGING)


def band_limits_mm(tolerance_mm: float) -> FloatArray:
    """Return where the bands of a tolerance end that `DIVERGING` has the colours of: at it and at its half."""
    return tolerance_mm * np.array([-1.0, -0.5, 0.5, 1.0])


def band_numbers(deviations_mm: FloatArray, tolerance_mm: float) -> NDArray[np.int64]:
    """Return which band each deviation (N,) lies in, from far inside; what lies at a limit is not beyond it."""
    nearer = np.searchsorted(band_limits_mm(tolerance_mm)[2:], np.abs(deviations_mm))
    return 2 + np.where(deviations_mm < 0, -nearer, nearer)


def faint(color: Rgb) -> Rgb:
    """Return a colour that steps back behind that of the picked capture, on a white and on a black ground."""
    pairs = zip(color, DIVERGING[2], strict=True)
    red, green, blue = (round((1 - _FAINT) * own + _FAINT * grey) for own, grey in pairs)
    return red, green, blue


def faint_colors(colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the same for colours (N, 3)."""
    return ((1 - _FAINT) * colors + _FAINT * np.array(DIVERGING[2])).round().astype(np.uint8)


def intensity_colors(intensities: NDArray[np.floating], low: float, high: float) -> NDArray[np.uint8]:
    """Return greys (N, 3) of intensities (N,) from `low` (dark) to `high` (light); those not known are blue."""
    colors = _between(intensities.astype(float), low, max(high, low + 1e-9), GREYS)
    colors[~np.isfinite(intensities)] = FIRST
    return colors


def height_colors(heights_mm: FloatArray, low_mm: float, high_mm: float) -> NDArray[np.uint8]:
    """Return the viridis colours (N, 3) of heights (N,) from `low_mm` (dark) to `high_mm` (light)."""
    return _between(heights_mm, low_mm, max(high_mm, low_mm + 1e-6), VIRIDIS)


def _between(values: FloatArray, low: float, high: float, colors: Sequence[Rgb]) -> NDArray[np.uint8]:
    at = np.linspace(low, high, len(colors))
    stops = np.array(colors, dtype=float)
    channels = [np.interp(values, at, stops[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=1).round().astype(np.uint8)


def css(color: Rgb) -> str:
    """Return a colour as CSS writes it."""
    return f"rgb({color[0]} {color[1]} {color[2]})"


def length_text(length_mm: float) -> str:
    """Return a length with the unit that reads best: µm below a millimetre."""
    return f"{length_mm:g} mm" if length_mm >= 1 else f"{length_mm * 1000:g} µm"
