"""Blocks as text for a terminal."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, Final
from unicodedata import east_asian_width

from calib_core.evidence.numbers import number_text, pointed, quantity_text, with_unit
from calib_core.messages import ENGLISH, Catalogue, message, templates
from calib_core.records.evidence import (
    AnyBlock,
    Column,
    Figure,
    Frame,
    Note,
    Picture,
    Plot,
    Quantity,
    Row,
    Series,
    Table,
)

MOST_IN_SIGHT: Final = 3
"""So many warnings are in sight; the others are shown on demand."""

_VERDICT_WORDS: Final = templates({"pass": "PASS", "warn": "WARN", "fail": "FAIL"})
_VERDICT_MEANINGS: Final = templates({
    "pass": "The captures agree with each other and determine the answer.",
    "warn": "Usable with care: read the warnings before you rely on it.",
    "fail": "Do not use this result: the warnings say what to do.",
})  # fmt: skip

_WIDTH: Final = 100
_BARS: Final = "▁▂▃▄▅▆▇█"
_SHADES: Final = " ░▒▓█"
_MOST_BARS: Final = 60
_STAYS: Final = re.compile(r"(?<=\w) (?=[=%])|(?<=[=±]) (?=\d)|(?<=\d) (?=(?:mm|px|σ)\b)")
_PIECES: Final = re.compile(r"[ \n]+|[（“《]*(?:[^ \n\u2e80-\uffff]+|[\u2e80-\uffff])[）”》，。：；、！？]*")
_WORDS: Final = templates({
    "pass": "OK",
    "warn": "Warning",
    "fail": "Failed",
    "info": "Note",
    "picture": "Picture",
    "stale": "out of date",
})  # fmt: skip


def result_text(
    title: str, result: Mapping[str, Any], blocks: Sequence[AnyBlock], said: Catalogue = ENGLISH
) -> str:
    """Return a result, given as JSON data, as text: verdict, headline, warnings, then the rest of its evidence.

    Three warnings stand in sight; further ones follow at the end.  Its texts and those of its blocks are in the
    language already; `said` has the few words between them.
    """
    headline, rest = split_headline(blocks)
    warnings: list[str] = list(result.get("warnings") or [])
    word, meaning = verdict_words(result["verdict"], said)
    about = said.listed([title, *([_WORDS["stale"]] if result.get("stale") else ())], said.comma)
    parts = [
        f"{result.get('stage', '')}: {word}  ({about})\n{meaning}",
        blocks_text(headline, said=said),
        _sentences(_WORDS["warn"], warnings[:MOST_IN_SIGHT], said),
        blocks_text(rest, said=said),
        _sentences(_WORDS["warn"], warnings[MOST_IN_SIGHT:], said),
        _sentences(_WORDS["info"], result.get("notes") or [], said),
    ]
    return plain("\n\n".join(part for part in parts if part))


def verdict_words(verdict: str, said: Catalogue = ENGLISH) -> tuple[str, str]:
    """Return a verdict as one word, and the sentence that says what it means."""
    return said.say(_VERDICT_WORDS[verdict]), said.say(_VERDICT_MEANINGS[verdict])


def _sentences(label: str, texts: Sequence[str], said: Catalogue) -> str:
    """Return sentences, each after the same label."""
    shown = (pointed(text, said.language) for text in texts)
    return "\n".join(line for text in shown for line in _wrapped(said.say(label), text))


def split_headline(blocks: Sequence[AnyBlock]) -> tuple[list[AnyBlock], list[AnyBlock]]:
    """Return the blocks before the first title, which stand beside the verdict, and the others."""
    first = next((k for k, block in enumerate(blocks) if block.title or block.detail), len(blocks))
    return list(blocks[:first]), list(blocks[first:])


def sections(blocks: Sequence[AnyBlock]) -> list[list[AnyBlock]]:
    """Return blocks by section: a title begins one, and so does what is shown on demand after what is not."""
    found: list[list[AnyBlock]] = []
    for block in blocks:
        if not found or block.title or block.detail != found[-1][0].detail:
            found.append([])
        found[-1].append(block)
    return found


def runs(blocks: Sequence[AnyBlock]) -> Iterator[list[Figure] | AnyBlock]:
    """Give a section's blocks, with figures that follow each other in one list."""
    for is_figure, run in groupby(blocks, lambda block: isinstance(block, Figure)):
        group = list(run)
        if is_figure:
            yield [block for block in group if isinstance(block, Figure)]
        else:
            yield from group


def blocks_text(blocks: Sequence[AnyBlock], detail: bool = False, said: Catalogue = ENGLISH) -> str:
    """Return blocks as lines of text; what is shown on demand only where `detail` is asked for."""
    lines: list[str] = []
    for section in sections([block for block in blocks if detail or not block.detail]):
        lines += ["", section[0].title] if section[0].title else []
        for run in runs(section):
            told = _figures(run, said) if isinstance(run, list) else _lines(run, said)
            lines += told if isinstance(run, Frame | Table) else [pointed(line, said.language) for line in told]
    return plain("\n".join(lines).strip("\n"))


def plain(text: str) -> str:
    """Return text with the signs of a keyboard: hyphens for minus signs, ordinary spaces."""
    return text.replace("−", "-").replace("\u202f", " ").replace("\u00a0", " ")


def _wrapped(label: str, text: str) -> list[str]:
    """Return a sentence after its label, broken into lines that begin below each other."""
    return _broken(text, padded(label, 10), " " * 10)


def _broken(text: str, first: str, others: str) -> list[str]:
    """Return text in lines, each as wide as the terminal allows, that begin as told.

    A line may end between any two Chinese characters, which are two columns wide; numbers stay with their signs
    and units, and no line begins with what closes a sentence.
    """
    lines, end = [first], True
    for piece in _PIECES.findall(_STAYS.sub("\u00a0", text)):
        if piece.isspace() and piece != "\u00a0":
            lines[-1] += "" if end else " "
        elif not end and _columns(lines[-1] + piece) > _WIDTH:
            lines[-1:] = [lines[-1].rstrip(), others + piece]
        else:
            lines[-1] += piece
        end = end and piece.isspace()
    return [line.rstrip() for line in lines] if text else []


def _columns(text: str) -> int:
    return sum(2 if east_asian_width(one) in "WF" else 1 for one in text)


def padded(text: str, width: int, right: bool = False) -> str:
    """Return text in so many columns of a terminal; a Chinese character takes two."""
    spaces = " " * (width - _columns(text))
    return spaces + text if right else text + spaces


def _lines(block: AnyBlock, said: Catalogue) -> list[str]:
    match block:
        case Figure():
            return _figures([block], said)
        case Frame():
            return _frame(block, said)
        case Table():
            return _table(block, said)
        case Plot():
            return _plot(block, said)
        case Picture():
            return _wrapped(said.say(_WORDS["picture"]), block.alt)
        case Note():
            return _wrapped(said.say(_WORDS[block.level]), block.text)


def _figures(figures: Sequence[Figure], said: Catalogue) -> list[str]:
    width = max(_columns(figure.label) for figure in figures)
    return [f"  {padded(figure.label, width)}  {figure_text(figure, said)}" for figure in figures]


def figure_text(figure: Figure, said: Catalogue = ENGLISH) -> str:
    """Return what stands beside a figure's label: number, limit and remark."""
    parts = [figure.text] if figure.text else [quantity_text(figure.quantity)]
    if figure.limit is not None:
        parts.append(f"({figure.limit_label or said.say('Limit')} {quantity_text(figure.limit)})")
    if figure.remark:
        parts.append(f"({figure.remark})")
    return " ".join(parts)


def _frame(frame: Frame, said: Catalogue) -> list[str]:
    head = said.say(message("{frame} as {units}", frame=frame.name, units=frame.convention))
    matrix = ["  " + " ".join(f"{v:12.6f}" for v in row) for row in frame.matrix]
    if not frame.numbers:
        return [f"  {head}", *matrix]
    texts = [quantity_text(number.quantity) for number in frame.numbers]
    labels = max(_columns(number.label) for number in frame.numbers)
    widths = [len(text.split(" ±")[0]) for text in texts]
    rows = [
        f"  {padded(number.label, labels)}  {' ' * (max(widths) - width)}{text}"
        for number, text, width in zip(frame.numbers, texts, widths, strict=True)
    ]
    return [f"  {head}", *(matrix if frame.convention == "matrix" else []), *rows]


def cell_text(cell: str | float | Quantity | None, column: Column) -> str:
    """Return what stands in a table's cell; a plain number has its column's decimals and no unit."""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Quantity):
        return quantity_text(cell)
    return number_text(cell, column.decimals)


def head_text(column: Column) -> str:
    """Return a column's label with its unit."""
    return f"{column.label}, {column.unit}" if column.unit else column.label


def _caption(text: str) -> list[str]:
    return _broken(text, "  ", "  ")


def _table(table: Table, said: Catalogue) -> list[str]:
    def shown(cell: str | float | Quantity | None, column: Column) -> str:
        text = cell_text(cell, column)
        return text if column.own else pointed(text, said.language)

    rows = [[shown(c, column) for c, column in zip(row.cells, table.columns, strict=True)] for row in table.rows]
    heads = [head_text(column) for column in table.columns]
    widths = [max(_columns(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    marks = [" " if row.used else "×" for row in table.rows]

    def line(cells: Sequence[str], mark: str = " ") -> str:
        placed = [
            padded(cell, width, right=column.align != "left" and k > 0)
            for k, (cell, width, column) in enumerate(zip(cells, widths, table.columns, strict=True))
        ]
        return f"{mark} {'  '.join(placed)}".rstrip()

    lines = [line(heads), *map(line, rows, marks)]
    lines += [pointed(line, said.language) for line in _reasons(table.rows)]
    return [*_caption(pointed(table.caption, said.language)), *lines]


def _reasons(rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        if not row.used and row.reason:
            yield from _wrapped("× " + (row.capture or ""), row.reason)


def _plot(plot: Plot, said: Catalogue) -> list[str]:
    lines = _caption(plot.caption)
    for series in plot.series if plot.shape != "section" else []:
        if plot.shape == "grid":
            lines.append("  " + _shaded(series, plot))
            continue
        lines.append(f"  {_bars(series.y)}  {_range(series, plot, said)}".rstrip())
    if plot.band is not None:
        low, high = number_text(plot.band.low, 1), number_text(plot.band.high, 1)
        band = message("{what}: {why}", what=plot.band.label, why=f"{low} … {with_unit(high, plot.y.unit)}")
        lines.append("  " + said.say(band))
    return lines


def _range(series: Series, plot: Plot, said: Catalogue) -> str:
    """Return the largest value of a series with its capture."""
    known = [(abs(y), k) for k, y in enumerate(series.y) if y is not None]
    if not known:
        return series.label
    largest = max(known)[1]
    where = f" ({series.captures[largest]})" if series.captures else ""
    value = with_unit(number_text(series.y[largest], 2), plot.y.unit)
    told = message("largest {value}", value=value + where)
    return said.say(message("{what}: {why}", what=series.label, why=told) if series.label else told)


def _bars(values: Sequence[float | None]) -> str:
    """Return values as bars between the smallest (or zero) and the largest; many are shown by their largest."""
    step = max(1, math.ceil(len(values) / _MOST_BARS))
    parts = [values[k : k + step] for k in range(0, len(values), step)]
    tops = [max((v for v in part if v is not None), default=None) for part in parts]
    known = [v for v in tops if v is not None]
    low, high = min(0.0, *known) if known else 0.0, max(known, default=0.0)
    return "".join(
        " " if v is None else _BARS[min(int((v - low) / (high - low or 1.0) * len(_BARS)), len(_BARS) - 1)]
        for v in tops
    )


def _shaded(series: Series, plot: Plot) -> str:
    most = max((v for one in plot.series for v in one.y if v is not None), default=0.0) or 1.0
    return "".join(_SHADES[math.ceil(max(v or 0.0, 0.0) / most * (len(_SHADES) - 1))] * 2 for v in series.y)
