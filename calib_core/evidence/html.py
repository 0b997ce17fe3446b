"""Blocks as HTML: a fragment for the report and for notebooks, without scripts and addresses.

`STYLE` (in `style`) goes with it, once a page; all that it styles is within an element of class ``scancell``.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from typing import Any, Final

from calib_core.evidence.numbers import number_text, pointed, quantity_text, with_unit
from calib_core.evidence.svg import plot_svg
from calib_core.evidence.text import (
    MOST_IN_SIGHT,
    cell_text,
    figure_text,
    head_text,
    runs,
    sections,
    split_headline,
    verdict_words,
)
from calib_core.messages import ENGLISH, Catalogue, message, templates
from calib_core.records.evidence import AnyBlock, Figure, Frame, Note, Picture, Plot, Row, Series, Table

Address = Callable[[str], str]
STALE: Final = "Out of date: cell, captures or files have changed since. Solve again."

_WORDS: Final = templates({
    "stale": STALE,
    "further": "Further warnings",
    "notes": "Notes",
    "details": "Details",
    "expanded": "± at k = 2",
    "matrix": "As a matrix",
    "used": "Used",
    "yes": "yes",
    "no": "no",
    "numbers": "The plot's numbers",
    "series": "Series",
})  # fmt: skip
_TAGS: Final = re.compile(r"(<[^>]*>)")
_MARKS: Final = ("●", "■", "▲")
_MATRIX_DECIMALS: Final = (6, 6, 6, 4)


def result_html(
    result: Mapping[str, Any],
    blocks: Sequence[AnyBlock],
    said: Catalogue = ENGLISH,
    address: Address | None = None,
) -> str:
    """Return a result, given as JSON data, as HTML: verdict, headline, warnings, then the rest of its evidence.

    Its texts and those of its blocks are in the language already; `said` has the few words between them.
    `address` tells where a capture's file is to be seen, "" where it cannot be; without it, pictures are words.
    """
    headline, rest = split_headline(blocks)
    warnings: list[str] = list(result.get("warnings") or [])
    word, meaning = verdict_words(result["verdict"], said)
    more = _list(warnings[MOST_IN_SIGHT:])
    parts = [
        f'<p><strong class="verdict {result["verdict"]}">{word}</strong> {meaning}</p>',
        f'<p class="warn">{_word("stale", said)}</p>' if result.get("stale") else "",
        blocks_html(headline, said),
        _list(warnings[:MOST_IN_SIGHT]),
        f"<details><summary>{_word('further', said)}</summary>{more}</details>" if more else "",
        blocks_html(rest, said, address),
        f"<h3>{_word('notes', said)}</h3>{_list(result['notes'])}" if result.get("notes") else "",
    ]
    return _pointed("".join(parts), said)


def _pointed(page: str, said: Catalogue) -> str:
    """Return HTML whose texts have the decimal sign of a language; tags, and points that are written so, stay."""
    if said.language != "de":
        return page
    parts = _TAGS.split(page)
    return "".join(part if place % 2 else pointed(part, said.language) for place, part in enumerate(parts))


def _as_typed(text: str, said: Catalogue) -> str:
    """Return a number that is typed elsewhere, or a word of somebody's own: its points stay in every language."""
    return text.replace(".", "&#46;") if said.language == "de" else text


def _word(name: str, said: Catalogue) -> str:
    return escape(said.say(_WORDS[name]))


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in sentences)}</ul>" if sentences else ""


def blocks_html(blocks: Sequence[AnyBlock], said: Catalogue = ENGLISH, address: Address | None = None) -> str:
    """Return blocks as HTML; what is shown on demand stands in elements that open."""
    parts: list[str] = []
    for section in sections(blocks):
        first = section[0]
        body = "".join(_section(section, said, address))
        if first.detail:
            title = escape(first.title) if first.title else _word("details", said)
            parts.append(f"<details><summary>{title}</summary>{body}</details>")
        else:
            parts.append((f"<h3>{escape(first.title)}</h3>" if first.title else "") + body)
    return _pointed("".join(parts), said)


def _section(blocks: Sequence[AnyBlock], said: Catalogue, address: Address | None) -> Iterator[str]:
    for run in runs(blocks):
        yield _figures(run, said) if isinstance(run, list) else _block(run, said, address)


def _block(block: AnyBlock, said: Catalogue, address: Address | None) -> str:
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
            shown = address(block.file) if address and block.file else ""
            image = f'<img src="{escape(shown)}" alt="">' if shown else ""
            return f'{image}<p class="soft">{escape(block.alt)}</p>'
        case Note():
            level = block.level if block.level != "info" else "words"
            return f'<p class="{level}">{escape(block.text)}</p>'


def _figures(figures: Sequence[Figure], said: Catalogue) -> str:
    return f"<table>{''.join(_figure(one, said) for one in figures)}</table>"


def _figure(figure: Figure, said: Catalogue) -> str:
    css = ' class="headline"' if figure.headline else ""
    css_of_value = "n" if figure.quantity else "n words"
    value = f'<td class="{css_of_value}">{escape(figure_text(figure, said))}</td>'
    return f'<tr{css}><th scope="row">{escape(figure.label)}</th>{value}</tr>'


def _frame(frame: Frame, said: Catalogue) -> str:
    as_units = said.say(message("{frame} as {units}", frame=frame.name, units=frame.convention))
    rows_in_mm = said.say(message("{frame}, rows, mm", frame=frame.name))
    cells = ("".join(map(_number, row, _MATRIX_DECIMALS)) for row in frame.matrix)
    matrix = _as_typed("".join(f"<tr>{row}</tr>" for row in cells), said)
    matrix_of = f'<p class="soft">{escape(rows_in_mm)}</p><div class="wide"><table>{matrix}</table></div>'
    if not frame.numbers:
        return matrix_of
    opened = " open" if frame.convention == "matrix" else ""
    numbers = ((escape(one.label), _as_typed(quantity_text(one.quantity), said)) for one in frame.numbers)
    rows = "".join(f'<tr><th scope="row">{name}</th><td class="n">{told}</td></tr>' for name, told in numbers)
    return (
        f'<p class="soft">{escape(as_units)}; {escape(frame.formula)}; {_word("expanded", said)}</p>'
        f'<table class="frame">{rows}</table>'
        f"<details{opened}><summary>{_word('matrix', said)}</summary>{matrix_of}</details>"
    )


def _number(value: float, decimals: int) -> str:
    return f'<td class="n">{number_text(value, decimals)}</td>'


def _table(table: Table, said: Catalogue) -> str:
    judged = any(not row.used for row in table.rows)
    css = ["" if k == 0 or column.align == "left" else ' class="n"' for k, column in enumerate(table.columns)]
    heads = "".join(
        f'<th scope="col"{c}>{escape(head_text(column))}</th>'
        for c, column in zip(css, table.columns, strict=True)
    )
    heads += f'<th scope="col">{_word("used", said)}</th>' if judged else ""
    caption = f'<p class="soft">{escape(table.caption)}</p>' if table.caption else ""
    rows = "".join(_row(row, table, css, judged, said) for row in table.rows)
    return f'{caption}<div class="wide"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'


def _row(row: Row, table: Table, css: Sequence[str], judged: bool, said: Catalogue) -> str:
    cells = zip(row.cells, table.columns, strict=True)
    shown = ((escape(cell_text(cell, column)), column.own) for cell, column in cells)
    texts = [_as_typed(text, said) if own else text for text, own in shown]
    made = "".join(
        f'<th scope="row">{text}</th>' if not k else f"<td{c}>{text}</td>"
        for k, (c, text) in enumerate(zip(css, texts, strict=True))
    )
    if judged:
        used = _word("yes" if row.used else "no", said) + (
            f": {escape(row.reason)}" if row.reason and not row.used else ""
        )
        made += f'<td class="words">{used}</td>'
    return f"<tr>{made}</tr>" if row.used else f'<tr class="out">{made}</tr>'


def _plot(plot: Plot, said: Catalogue) -> str:
    legend = "".join(
        f'<span class="s{number % 3}">{_MARKS[number % 3]}</span> {escape(series.label)} '
        for number, series in enumerate(plot.series)
        if series.label and plot.shape != "grid"
    )
    legend = f'<p class="soft">{legend}</p>' if legend else ""
    numbers = "" if plot.shape == "section" else _numbers_of(plot, said)
    return f'<p class="soft">{escape(plot.caption)}</p>{legend}{plot_svg(plot)}{numbers}'


def _numbers_of(plot: Plot, said: Catalogue) -> str:
    """Return a plot's points as a table, for who cannot see it."""
    rows = "".join(_point_rows(plot))
    heads = "".join(
        f'<th scope="col">{escape(head)}</th>'
        for head in (
            said.say(_WORDS["series"]),
            plot.x.label,
            with_unit(plot.y.label, f"({plot.y.unit})" if plot.y.unit else ""),
        )
    )
    summary = f"<summary>{_word('numbers', said)}</summary>"
    return f'<details class="numbers">{summary}<table><tr>{heads}</tr>{rows}</table></details>'


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
