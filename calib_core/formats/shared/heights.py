"""Grids of heights: rows along y, columns along x, with their pitches."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.formats.format import Reading, Settings
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.unnamed import Column
from calib_core.frames import FloatArray
from calib_core.records.base import Finite, Positive


class HeightSettings(Settings):
    """As `Settings`, and what a grid of heights does not say: its pitches, its start, what a count is worth.

    A point is x_start_mm + column · x_pitch_mm, y_start_mm + row · y_pitch_mm, and z_offset_mm +
    (value − z_zero) · z_scale_mm; Keyence and LMI count from 32768.
    """

    x_pitch_mm: Positive | None = None
    y_pitch_mm: Positive | None = None
    x_start_mm: Finite = 0.0
    y_start_mm: Finite = 0.0
    z_scale_mm: Finite | None = None
    z_zero: Finite = 0.0
    z_offset_mm: Finite = 0.0


def grid_of(heights: NDArray[Any], settings: HeightSettings, where: str) -> Reading:
    """Return the points of heights (H, W) that are NaN where nothing came back; counts need `z_scale_mm`.

    Raises
    ------
    InputError
        If a pitch or the scale is neither in the file nor in the settings.
    """
    lacking = [name for name in ("x_pitch_mm", "y_pitch_mm") if getattr(settings, name) is None]
    if heights.dtype.kind in "iu" and settings.z_scale_mm is None:
        lacking.append("z_scale_mm")
    if lacking:
        raise InputError(
            "the pitch of the columns and of the rows of a grid of heights, and what a count is worth",
            "{height} × {width} values without {lacking}",
            "Give them in the capture's format_settings, from the scanner's export dialogue.",
            where,
            height=heights.shape[0],
            width=heights.shape[1],
            lacking=", ".join(lacking),
        )
    assert settings.x_pitch_mm is not None
    assert settings.y_pitch_mm is not None
    values = heights.astype(np.float64)
    values[np.isin(values, settings.missing)] = np.nan
    scale_mm = 1.0 if settings.z_scale_mm is None else settings.z_scale_mm
    z_mm = settings.z_offset_mm + scale_mm * (values - settings.z_zero)
    x_mm = settings.x_start_mm + settings.x_pitch_mm * np.arange(heights.shape[1])
    y_mm = settings.y_start_mm + settings.y_pitch_mm * np.arange(heights.shape[0])
    return grid_with_axes(x_mm, y_mm, z_mm, where, Settings(unit="mm"))


def grid_with_axes(x: FloatArray, y: FloatArray, z: FloatArray, where: str, settings: Settings) -> Reading:
    """Return the points of heights z (H, W) over x (W,) and y (H,)."""
    points = np.empty((*z.shape, 3))
    points[..., 0], points[..., 1], points[..., 2] = x[None, :], y[:, None], z
    flat = points.reshape(-1, 3)
    flat[np.isnan(flat[:, 2])] = np.nan
    columns = [Column("x", 0, "across the columns", None), Column("y", 1, "down the rows", None)]
    reading = points_of(flat, [*columns, Column("z", 2, "values", None)], "cloud", where, settings)
    return replace(reading, grid=(z.shape[0], z.shape[1]))
