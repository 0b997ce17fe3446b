"""The residual plot: one dot a capture over the band that good captures keep to, rejected ones crossed."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

from markupsafe import Markup, escape

from calib_core.records import TcpResidual, TurntableResidual

Residual = TcpResidual | TurntableResidual

BAND: Final = 2.795
"""The 95 % quantile of the length of three independent standard normal numbers (χ², 3 degrees of freedom)."""

_WIDTH, _HEIGHT, _LEFT, _BOTTOM, _TOP = 760, 230, 46, 46, 14
_LEAST_TOP: Final = 4.0
_MOST_LABELS: Final = 40


def residual_plot(rows: Sequence[Residual]) -> Markup:
    """Return an SVG of how far each capture's sphere lies from where the others expect it, in its own sigmas.

    A capture beyond the scale, as rejected ones often are, is drawn at its upper edge.
    """
    if not any(row.mahalanobis is not None for row in rows):
        return Markup("")
    used = [row.mahalanobis for row in rows if row.used and row.mahalanobis is not None]
    top = max(_LEAST_TOP, math.ceil(max(used, default=0.0) + 0.5))
    parts = [*_frame(top), *_marks(rows, top)]
    label = escape("Distance of each capture's sphere from where the others expect it, in standard deviations")
    return Markup(f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{label}">{"".join(parts)}</svg>')


def _y(value: float, top: float) -> float:
    return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (1 - min(value / top, 1.0))


def _x(index: int, count: int) -> float:
    return _LEFT + (index + 0.5) * (_WIDTH - _LEFT) / count


def _frame(top: float) -> Iterator[str]:
    band_y, zero_y = _y(BAND, top), _y(0.0, top)
    width = _WIDTH - _LEFT
    yield f'<rect class="band" x="{_LEFT}" y="{band_y:.1f}" width="{width}" height="{zero_y - band_y:.1f}"/>'
    step = max(1, math.ceil(top / 6))
    for value in range(0, int(top) + 1, step):
        y = _y(value, top)
        yield f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH}" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{value}</text>'
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    place = f"translate(12 {middle:.0f}) rotate(-90)"
    yield f'<text transform="{place}" text-anchor="middle">standard deviations</text>'


def _marks(rows: Sequence[Residual], top: float) -> Iterator[str]:
    every = math.ceil(len(rows) / _MOST_LABELS)
    longest = max(len(row.capture) for row in rows)
    turned = longest * 7 + 8 > (_WIDTH - _LEFT) / len(rows) * every
    for index, row in enumerate(rows):
        x = _x(index, len(rows))
        if index % every == 0:
            yield _name(row.capture, x, turned)
        if row.mahalanobis is not None:
            yield _mark(row, x, _y(row.mahalanobis, top))


def _name(capture: str, x: float, turned: bool) -> str:
    y = _HEIGHT - _BOTTOM + 16
    shown = escape(capture if len(capture) <= 12 else f"{capture[:11]}…")
    if turned:
        place = f'transform="translate({x:.1f} {y - 4}) rotate(-40)" text-anchor="end"'
    else:
        place = f'x="{x:.1f}" y="{y}" text-anchor="middle"'
    return f"<text {place}>{shown}</text>"


def _mark(row: Residual, x: float, y: float) -> str:
    title = f"<title>{escape(row.capture)}: {row.mahalanobis:.2f}</title>"
    if row.used:
        return f'<circle class="used" cx="{x:.1f}" cy="{y:.1f}" r="4">{title}</circle>'
    cross = f"M{x - 5:.1f} {y - 5:.1f}l10 10m0 -10l-10 10"
    return f'<path class="rejected" d="{cross}">{title}</path>'
