"""Values that stand where nothing came back: 0, −999, 65535, 1e6 and their like; none of them is a point."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib_core.formats.format import PointKind
from calib_core.frames import FloatArray
from calib_core.messages import message, plural

_EDGES = {2.0**bits - off for bits in (15, 16, 31, 32) for off in (0.0, 1.0)}
_TENS = {10.0**power for power in range(5, 39)}
_NINES = re.compile(r"9{3,}8?")
_LARGEST_SINGLE = 3.4e38
_MOST_ENDS = 12


def without_missing(
    points: FloatArray, told: Sequence[float], kind: PointKind
) -> tuple[FloatArray, tuple[str, ...], tuple[str, ...]]:
    """Return points (N, K) with NaN in the rows without a value, and notes and doubts about what was taken so.

    The last column is the height.  A value counts as missing where the user says so, where it is one that scanners
    write (−999, −9999.99, 32768, 65535, 1e6 …) and lies far from all others in its column, and where it is a
    height of exactly 0, again and again and far from all others.  The array that is given may be written into.
    """
    notes: list[str] = []
    doubts: list[str] = []
    if told:
        _blank(
            points,
            np.asarray(np.isin(points, np.array(told)).any(axis=1)),
            ", ".join(f"{v:g}" for v in told),
            notes,
        )
    for place in range(points.shape[1]):
        column = points[:, place]
        for value in _written_ends(column):
            _blank(points, column == value, f"{value:.7g}", notes)
    _blank_zeros(points, kind, notes, doubts)
    return points, tuple(notes), tuple(doubts)


def _blank(points: FloatArray, hit: NDArray[np.bool_], value: str, notes: list[str]) -> None:
    count = int(hit.sum())
    if count:
        points[hit] = np.nan
        rows = plural("{count} row", "{count} rows", by="count", count=count)
        notes.append(
            message("{rows} with {value} taken as missing: nothing came back there.", rows=rows, value=value)
        )


def _written_ends(column: FloatArray) -> list[float]:
    """Return the outermost values that scanners write for nothing, where they lie apart from the rest."""
    ends = (float(np.fmin.reduce(column)), float(np.fmax.reduce(column))) if len(column) else ()
    if not any(_is_written(abs(end)) for end in ends):
        return []
    rest = column[np.isfinite(column)]
    found: list[float] = []
    while len(rest) and len(found) < _MOST_ENDS:
        ends = {float(rest.min()), float(rest.max())}
        written = [end for end in ends if _is_written(abs(end))]
        if not written:
            break
        found += written
        rest = rest[~np.isin(rest, written)]
    if not len(rest):
        return [value for value in found if abs(value) >= 999]
    low, high = float(rest.min()), float(rest.max())
    return [value for value in found if max(low - value, value - high) > max(high - low, 20.0)]


def _is_written(value: float) -> bool:
    if value < 99:
        return False
    digits = {f"{value:.{places}g}".replace(".", "") for places in (7, 10)}
    nines = any(_NINES.fullmatch(text) for text in digits)
    return nines or value in _EDGES or value in _TENS or value >= _LARGEST_SINGLE / 2


def _blank_zeros(points: FloatArray, kind: PointKind, notes: list[str], doubts: list[str]) -> None:
    """Blank rows of zeros alone, twice or far from all others, and heights of exactly 0 far from all others."""
    height = points[:, -1]
    zero = height == 0
    if not zero.any():
        return
    all_zero = zero & (points == 0).all(axis=1)
    others = height[np.isfinite(height) & ~zero]
    nearest, span = (float(np.abs(others).min()), float(np.ptp(others))) if len(others) else (0.0, 0.0)
    apart = nearest > max(span, 1e-12)
    if all_zero.sum() > 1 or (all_zero.any() and apart):
        _blank(points, all_zero, "zeros alone", notes)
        zero &= ~all_zero
    count = int(zero.sum())
    if not count or not len(others):
        return
    far = apart or (count > 2 and nearest > 0.2 * span)
    if far or (count > max(5, 0.02 * len(height)) and nearest > 20 * _step(height[~zero])):
        _blank(points, zero, "a height of exactly 0", notes)
        if kind == "cloud" or not far:
            doubts.append(
                message(
                    "{count} heights are exactly 0 and were taken as missing: look whether they are points.",
                    count=count,
                )
            )


def _step(height: FloatArray) -> float:
    steps = np.abs(np.diff(height[np.isfinite(height)]))
    return float(np.median(steps)) if len(steps) else np.inf
