"""Blocks as HTML: a fragment for the report and for notebooks, without scripts and addresses.

`STYLE` (in `style`) goes with it, once a page; all that it styles is within an element of class ``scancell``.
"""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any, Final

from calib_core.evidence.numbers import number_text, quantity_text, with_unit
from calib_core.evidence.svg import plot_svg
from calib_core.evidence.text import (
    MOST_IN_SIGHT,
    VERDICTS,
    cell_text,
    figure_text,
    head_text,
    runs,
    sections,
    split_headline,
)
from calib_core.records.evidence import AnyBlock, Figure, Frame, Note, Picture, Plot, Row, Series, Table

STALE: Final = "Out of date: cell, captures or files have changed since. Solve again."

_NUMBERS: Final = '<details class="numbers"><summary>The plot\'s numbers</summary>'
_MARKS: Final = ("●", "■", "▲")
_MATRIX_DECIMALS: Final = (6, 6, 6, 4)


def result_html(result: Mapping[str, Any], blocks: Sequence[AnyBlock]) -> str:
    """Return a result, given as JSON data, as HTML: verdict, headline, warnings, then the rest of its evidence."""
    headline, rest = split_headline(blocks)
    warnings: list[str] = list(result.get("warnings") or [])
    word, _, meaning = VERDICTS[result["verdict"]].partition(". ")
    more = _list(warnings[MOST_IN_SIGHT:])
    parts = [
        f'<p><strong class="verdict {result["verdict"]}">{word}</strong> {meaning}</p>',
        f'<p class="warn">{STALE}</p>' if result.get("stale") else "",
        blocks_html(headline),
        _list(warnings[:MOST_IN_SIGHT]),
        f"<details><summary>Further warnings</summary>{more}</details>" if more else "",
        blocks_html(rest),
        "<h3>Notes</h3>" + _list(result["notes"]) if result.get("notes") else "",
    ]
    return "".join(parts)


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in sentences)}</ul>" if sentences else ""


def blocks_html(blocks: Sequence[AnyBlock]) -> str:
    """Return blocks as HTML; what is shown on demand stands in elements that open."""
    parts: list[str] = []
    for section in sections(blocks):
        first = section[0]
        body = "".join(_section(section))
        if first.detail:
            parts.append(f"<details><summary>{escape(first.title or 'Details')}</summary>{body}</details>")
        else:
            parts.append((f"<h3>{escape(first.title)}</h3>" if first.title else "") + body)
    return "".join(parts)


def _section(blocks: Sequence[AnyBlock]) -> Iterator[str]:
    for run in runs(blocks):
        yield _figures(run) if isinstance(run, list) else _block(run)


def _block(block: AnyBlock) -> str:
    match block:
        case Figure():
            return _figures([block])
        case Frame():
            return _frame(block)
        case Table():
            return _table(block)
        case Plot():
            return _plot(block)
        case Picture():
            return f'<p class="soft">{escape(block.alt)}</p>'
        case Note():
            level = block.level if block.level != "info" else "words"
            return f'<p class="{level}">{escape(block.text)}</p>'


def _figures(figures: Sequence[Figure]) -> str:
    return f"<table>{''.join(map(_figure, figures))}</table>"


def _figure(figure: Figure) -> str:
    css = ' class="headline"' if figure.headline else ""
    value = f'<td class="n">{escape(figure_text(figure))}</td>'
    return f'<tr{css}><th scope="row">{escape(figure.label)}</th>{value}</tr>'


def _frame(frame: Frame) -> str:
    head = f"{frame.name} as {frame.units}; {frame.formula}"
    matrix = "".join(f"<tr>{''.join(map(_number, row, _MATRIX_DECIMALS))}</tr>" for row in frame.matrix)
    matrix_of = (
        f'<p class="soft">{escape(frame.name)}, rows, mm</p><div class="wide"><table>{matrix}</table></div>'
    )
    if not frame.numbers:
        return matrix_of
    opened = " open" if frame.convention == "matrix" else ""
    rows = "".join(
        f'<tr><th scope="row">{escape(number.label)}</th><td class="n">{quantity_text(number.quantity)}</td></tr>'
        for number in frame.numbers
    )
    return (
        f'<p class="soft">{escape(head)}; ± at k = 2</p><table class="frame">{rows}</table>'
        f"<details{opened}><summary>As a matrix</summary>{matrix_of}</details>"
    )


def _number(value: float, decimals: int) -> str:
    return f'<td class="n">{number_text(value, decimals)}</td>'


def _table(table: Table) -> str:
    judged = any(not row.used for row in table.rows)
    css = ["" if k == 0 or column.align == "left" else ' class="n"' for k, column in enumerate(table.columns)]
    heads = "".join(
        f'<th scope="col"{c}>{escape(head_text(column))}</th>'
        for c, column in zip(css, table.columns, strict=True)
    )
    heads += '<th scope="col">Used</th>' if judged else ""
    caption = f'<p class="soft">{escape(table.caption)}</p>' if table.caption else ""
    rows = "".join(_row(row, table, css, judged) for row in table.rows)
    return f'{caption}<div class="wide"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'


def _row(row: Row, table: Table, css: Sequence[str], judged: bool) -> str:
    texts = [escape(cell_text(cell, column)) for cell, column in zip(row.cells, table.columns, strict=True)]
    cells = "".join(
        f'<th scope="row">{text}</th>' if not k else f"<td{c}>{text}</td>"
        for k, (c, text) in enumerate(zip(css, texts, strict=True))
    )
    if judged:
        used = "yes" if row.used else f"no: {row.reason}" if row.reason else "no"
        cells += f'<td class="words">{escape(used)}</td>'
    return f"<tr>{cells}</tr>" if row.used else f'<tr class="out">{cells}</tr>'


def _plot(plot: Plot) -> str:
    legend = "".join(
        f'<span class="s{number % 3}">{_MARKS[number % 3]}</span> {escape(series.label)} '
        for number, series in enumerate(plot.series)
        if series.label and plot.shape != "grid"
    )
    legend = f'<p class="soft">{legend}</p>' if legend else ""
    return f'<p class="soft">{escape(plot.caption)}</p>{legend}{plot_svg(plot)}{_numbers_of(plot)}'


def _numbers_of(plot: Plot) -> str:
    """Return a plot's points as a table, for who cannot see it."""
    rows = "".join(_point_rows(plot))
    heads = "".join(
        f'<th scope="col">{escape(head)}</th>'
        for head in ("Series", plot.x.label, with_unit(plot.y.label, f"({plot.y.unit})" if plot.y.unit else ""))
    )
    return f"{_NUMBERS}<table><tr>{heads}</tr>{rows}</table></details>"


def _point_rows(plot: Plot) -> Iterator[str]:
    for series in plot.series:
        for k, y in enumerate(series.y):
            if y is not None:
                cells = (series.label, _place(series, k), number_text(y, 3))
                yield f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


def _place(series: Series, index: int) -> str:
    if series.captures:
        return series.captures[index]
    return number_text(series.x[index], 3) if series.x else str(index)
