"""A plot as SVG: readable in light and dark, in print and by screen readers; needs the classes of `html.STYLE`."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Final

from calib_core.evidence.numbers import number_text, with_unit
from calib_core.records.evidence import Axis, Plot, Series

_WIDTH, _HEIGHT, _TALL, _LEFT, _BOTTOM, _TOP, _RIGHT = 760, 240, 430, 58, 50, 14, 10
_MOST_LABELS: Final = 40
_MOST_TICKS: Final = 6
_MARGIN: Final = 0.06
_LETTER: Final = 7
_LARGEST_CELL, _ROOM_FOR_A_NUMBER = 46.0, 36.0
_DARK_SHADE: Final = 0.65  # of a cell: its number is drawn bright


@dataclass(frozen=True)
class _Scale:
    """From a value to its place on paper; what lies beyond is drawn at the edge."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        share = (min(max(value, self.low), self.high) - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)


def plot_svg(plot: Plot) -> str:
    """Return a plot as SVG text, nothing where it has no value."""
    if not any(y is not None for series in plot.series for y in series.y):
        return ""
    drawn = _grid(plot) if plot.shape == "grid" else _chart(plot)
    title = escape(plot.title or plot.y.label)
    return (
        f'<svg class="plot" viewBox="0 0 {_WIDTH} {_height(plot)}" role="img" aria-label="{title}">'
        f"<title>{title}</title><desc>{escape(plot.caption)}</desc>{''.join(drawn)}</svg>"
    )


def _chart(plot: Plot) -> Iterator[str]:
    x, y = _x_scale(plot), _y_scale(plot)
    if plot.shape == "section":
        x, y = _to_one_scale(x, y)
    yield from _band(plot, y)
    yield from _y_axis(plot.y, y)
    if plot.shape == "captures":
        yield from _capture_names(plot, x)
    else:
        yield from _x_axis(plot.x, x, y.start)
    if plot.shape == "section":
        yield from _section(plot, x, y)
        return
    for number, series in reversed([*enumerate(plot.series)]):  # the first lies on top
        yield from _series(plot, series, number % 3, x, y)


def _xs(series: Series) -> Sequence[float]:
    return series.x or range(len(series.y))


def _x_scale(plot: Plot) -> _Scale:
    if plot.shape == "captures":
        count = max(len(series.y) for series in plot.series)
        return _Scale(-0.5, count - 0.5, _LEFT, _WIDTH - _RIGHT)
    values = [v for series in plot.series for v in _xs(series)]
    low, high = _limits(plot.x, values)
    if plot.shape == "histogram" and len(values) > 1:
        high = max(high, values[-1] + values[1] - values[0])
    return _Scale(low, high, _LEFT, _WIDTH - _RIGHT)


def _y_scale(plot: Plot) -> _Scale:
    """Return the y axis: it shows all that is used and the band; what was rejected may lie beyond."""
    values = [y for series in plot.series for y, reason in _judged(series) if y is not None and reason is None]
    values = values or [y for series in plot.series for y in series.y if y is not None]
    if plot.band:
        values += [plot.band.low, plot.band.high]
    if plot.shape not in ("xy", "section"):
        values.append(0.0)
    low, high = _limits(plot.y, values)
    return _Scale(low, high, _height(plot) - _BOTTOM, _TOP)


def _height(plot: Plot) -> int:
    if plot.shape == "grid":
        return round(len(plot.series) * _cell_side(plot) + 2 * _TOP)
    return _TALL if plot.shape == "section" else _HEIGHT


def _to_one_scale(x: _Scale, y: _Scale) -> tuple[_Scale, _Scale]:
    """Return both scales with as many points of paper a unit, in the middle of where they were."""
    per_unit = min((x.end - x.start) / (x.high - x.low), (y.start - y.end) / (y.high - y.low))

    def spread(scale: _Scale) -> _Scale:
        room = 0.5 * (abs(scale.end - scale.start) / per_unit - (scale.high - scale.low))
        return replace(scale, low=scale.low - room, high=scale.high + room)

    return spread(x), spread(y)


def _section(plot: Plot, x: _Scale, y: _Scale) -> Iterator[str]:
    """Give the outline, then the dots of the other series."""
    outline, *others = plot.series
    path, pen = "", "M"
    for at, value in zip(_xs(outline), outline.y, strict=True):
        path += "" if value is None else f"{pen}{x(at):.1f} {y(value):.1f}"
        pen = "M" if value is None else "L"
    yield f'<path class="line s0" style="stroke-width: 1" d="{path}"/>'
    for number, series in enumerate(others, 1):
        dots = "".join(
            f"M{x(at):.1f} {y(value):.1f}h0"
            for at, value in zip(_xs(series), series.y, strict=True)
            if value is not None
        )
        yield f'<path class="line s{number % 3}" stroke-linecap="round" d="{dots}"/>'


def _judged(series: Series) -> Iterator[tuple[float | None, str | None]]:
    return zip(series.y, series.reasons or [None] * len(series.y), strict=True)


def _limits(axis: Axis, values: Sequence[float]) -> tuple[float, float]:
    low = min(values) if axis.low is None else axis.low
    high = max(values) if axis.high is None else axis.high
    room = _MARGIN * ((high - low) or abs(high) or 1.0)
    low = low - room if axis.low is None and low != 0 else low
    high = high + room if axis.high is None and high != 0 else high
    return (low, high) if high > low else (low, low + 1.0)


def _ticks(scale: _Scale) -> list[float]:
    rough = (scale.high - scale.low) / _MOST_TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough * (1 - 1e-9))
    return [k * step for k in range(math.ceil(scale.low / step - 1e-9), math.floor(scale.high / step + 1e-9) + 1)]


def _tick_texts(ticks: Sequence[float]) -> list[str]:
    step = ticks[1] - ticks[0] if len(ticks) > 1 else 1.0
    decimals = min(max(-math.floor(math.log10(step) + 1e-9), 0), 9)
    return [number_text(value, decimals) for value in ticks]


def _band(plot: Plot, y: _Scale) -> Iterator[str]:
    if plot.band is not None:
        top, bottom = y(plot.band.high), y(plot.band.low)
        size = f'width="{_WIDTH - _LEFT - _RIGHT}" height="{bottom - top:.1f}"'
        title = f"<title>{escape(plot.band.label)}</title>"
        yield f'<rect class="band" x="{_LEFT}" y="{top:.1f}" {size}>{title}</rect>'


def _y_axis(axis: Axis, y: _Scale) -> Iterator[str]:
    ticks = _ticks(y)
    for value, text in zip(ticks, _tick_texts(ticks), strict=True):
        at = y(value)
        yield f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}"/>'
        yield f'<text x="{_LEFT - 8}" y="{at + 4:.1f}" text-anchor="end">{text}</text>'
    place = f"translate(13 {(_TOP + y.start) / 2:.0f}) rotate(-90)"
    yield f'<text transform="{place}" text-anchor="middle">{_axis_text(axis)}</text>'


def _x_axis(axis: Axis, x: _Scale, bottom: float) -> Iterator[str]:
    ticks = _ticks(x)
    for value, text in zip(ticks, _tick_texts(ticks), strict=True):
        yield f'<text x="{x(value):.1f}" y="{bottom + 17:.0f}" text-anchor="middle">{text}</text>'
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    yield f'<text x="{middle:.0f}" y="{bottom + _BOTTOM - 8:.0f}" text-anchor="middle">{_axis_text(axis)}</text>'


def _axis_text(axis: Axis) -> str:
    return escape(f"{axis.label}, {axis.unit}" if axis.unit else axis.label)


def _capture_names(plot: Plot, x: _Scale) -> Iterator[str]:
    names = max((series.captures for series in plot.series), key=len)
    if not names:
        return
    every = math.ceil(len(names) / _MOST_LABELS)
    longest = max(len(name) for name in names)
    turned = longest * _LETTER + 8 > every * (x(1) - x(0))
    for index in range(0, len(names), every):
        shown = escape(names[index] if len(names[index]) <= 12 else f"{names[index][:11]}…")
        at, below = x(index), _HEIGHT - _BOTTOM + 16
        if turned:
            place = f'transform="translate({at:.1f} {below - 4}) rotate(-40)" text-anchor="end"'
        else:
            place = f'x="{at:.1f}" y="{below}" text-anchor="middle"'
        yield f"<text {place}>{shown}</text>"


def _series(plot: Plot, series: Series, number: int, x: _Scale, y: _Scale) -> Iterator[str]:
    points = [(x(at), value, reason) for at, (value, reason) in zip(_xs(series), _judged(series), strict=True)]
    if plot.shape == "line":
        path = " ".join(f"{at:.1f},{y(value):.1f}" for at, value, _ in points if value is not None)
        yield f'<polyline class="line s{number}" points="{path}"/>'
        return
    if plot.shape == "histogram":
        width = x(_xs(series)[1]) - x(_xs(series)[0]) - 1 if len(points) > 1 else 40.0
        for at, value, _ in points:
            top = y(value or 0.0)
            size = f'width="{width:.1f}" height="{y(0.0) - top:.1f}"'
            yield f'<rect class="mark s{number}" x="{at:.1f}" y="{top:.1f}" {size}/>'
        return
    for index, (at, value, reason) in enumerate(points):
        if value is not None:
            title = f"<title>{escape(_point_text(plot, series, index))}</title>"
            yield _MARKS[number](at, y(value), title) if reason is None else _cross(at, y(value), title)


def _point_text(plot: Plot, series: Series, index: int) -> str:
    value = series.y[index]
    name = series.captures[index] if series.captures else series.label
    reason = series.reasons[index] if series.reasons else None
    shown = with_unit(number_text(value, 3 if value is not None and abs(value) < 1 else 2), plot.y.unit)
    return f"{name}: {shown}" + (f": {reason}" if reason else "")


def _circle(x: float, y: float, title: str) -> str:
    return f'<circle class="mark s0" cx="{x:.1f}" cy="{y:.1f}" r="4">{title}</circle>'


def _square(x: float, y: float, title: str) -> str:
    return f'<rect class="mark s1" x="{x - 3.5:.1f}" y="{y - 3.5:.1f}" width="7" height="7">{title}</rect>'


def _triangle(x: float, y: float, title: str) -> str:
    return f'<path class="mark s2" d="M{x - 4.5:.1f} {y + 4:.1f}h9l-4.5 -8.5z">{title}</path>'


def _cross(x: float, y: float, title: str) -> str:
    return f'<path class="rejected" d="M{x - 5:.1f} {y - 5:.1f}l10 10m0 -10l-10 10">{title}</path>'


_MARKS: Final[tuple[Callable[[float, float, str], str], ...]] = (_circle, _square, _triangle)


def _grid(plot: Plot) -> Iterator[str]:
    """Give the cells of a grid, each shaded by its value, which stands in it where there is room."""
    side, known = _cell_side(plot), [v for series in plot.series for v in series.y if v is not None]
    most = max(known, default=0.0) or 1.0
    whole = all(value == int(value) for value in known)
    decimals = 0 if whole else min(max(1 - math.floor(math.log10(abs(most))), 0), 3)
    for row, series in enumerate(plot.series):
        for column, value in enumerate(series.y):
            shade = 0.0 if not value or value < 0 else 0.15 + 0.85 * math.sqrt(value / most)
            left, top = _RIGHT + column * side, _TOP + row * side
            place = f'x="{left:.1f}" y="{top:.1f}"'
            size = f'width="{side - 1:.1f}" height="{side - 1:.1f}"'
            title = with_unit(number_text(value, 3 if most < 100 and value != int(value or 0) else 0), plot.y.unit)
            css = "mark s0" if shade else "empty"
            opacity = f' fill-opacity="{shade:.2f}"' if shade else ""
            yield f'<rect class="{css}" {place} {size}{opacity}><title>{escape(title)}</title></rect>'
            if value is not None and side >= _ROOM_FOR_A_NUMBER:
                ink = f' style="fill: var(--{"paper" if shade > _DARK_SHADE else "ink"})"'
                at = f'x="{left + side / 2:.1f}" y="{top + side / 2 + 4:.1f}" text-anchor="middle"'
                yield f"<text {at}{ink}>{escape(number_text(value, decimals))}</text>"


def _cell_side(plot: Plot) -> float:
    """Return the side of a grid's cells: square ones, as those of an image are nearly."""
    return min(_LARGEST_CELL, (_WIDTH - 2 * _RIGHT) / max(len(series.y) for series in plot.series))
