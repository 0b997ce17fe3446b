"""Sections of the merged part beside its nominal, for a report: deviations drawn many times as large."""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.fusion.deviation import Nominal, plane_cut
from calib_core.stages.merge.record import PartSection

_MOST_POINTS, _MOST_LINES = 400, 800
_DRAWN = 0.04  # of the section's size: how large the scale's end is drawn
_STEPS = (1.0, 2.0, 5.0)


def part_sections(
    points: FloatArray, nominal: Nominal, origin_mm: FloatArray, width_mm: float, limit_mm: float
) -> list[PartSection]:
    """Return the sections through the nominal's middle across its longest and its shortest side.

    Parameters
    ----------
    points : (N, 3)
        Of the part, in the nominal's frame.
    nominal : Nominal
    origin_mm : (3,)
        What both count from, in the nominal's own frame.
    width_mm : float
        How thick the slice of points is.
    limit_mm : float
        The scale's end of the deviations.
    """
    low, high = nominal.corners_mm.min(axis=0), nominal.corners_mm.max(axis=0)
    sides = high - low
    found: list[PartSection] = []
    for axis in dict.fromkeys((int(np.argmax(sides)), int(np.argmin(sides)))):
        across = [other for other in range(3) if other != axis]
        at = float((low + high)[axis] / 2)
        lines = plane_cut(nominal.corners_mm[:, [*across, axis]], nominal.triangles, at)
        inside = _some(points[np.abs(points[:, axis] - at) <= width_mm / 2], _MOST_POINTS)
        if not len(lines) or not len(inside):
            continue
        magnified = _round(_DRAWN * float(sides[across].max()) / limit_mm)
        drawn = inside + (magnified - 1) * nominal.away(inside)[0]
        found.append(
            PartSection(
                axis="xyz"[axis],  # pyright: ignore[reportArgumentType]
                at_mm=round(at + float(origin_mm[axis]), 3),
                magnified=magnified,
                nominal=(_some(lines, _MOST_LINES) + origin_mm[across]).reshape(-1, 4).round(3).tolist(),
                points=(drawn[:, across] + origin_mm[across]).round(3).tolist(),
            )
        )
    return found


def _some(rows: FloatArray, most: int) -> FloatArray:
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def _round(times: float) -> float:
    """Return 1, 2, 5, 10, 20 … at most so many times, at least once."""
    power = 10.0 ** np.floor(np.log10(max(times, 1.0)))
    return float(power * max(step for step in _STEPS if power * step <= max(times, 1.0)))
