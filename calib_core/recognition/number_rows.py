"""Rows of numbers in a text of any form: separators, brackets, names and labels beside them passed over."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from calib_core.formats.shared.text_style import NUMBER, style_of

_BRACKETS = str.maketrans(dict.fromkeys("[](){}<>\"'", " "))
_COMMENTS = ("#", "//", "%", "!", ";", "--")
_VALUE = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_LABELLED = re.compile(rf"([A-Za-z]\w{{0,15}}) ?[=:] ?({_VALUE})(?![\w.])")
_COUNTER = re.compile(r"([0-9]{1,6})[:)]\Z")
_LONGEST_LINE = 4000
_MOST_WORDS = 2  # beside the numbers of a row: a name, a tool
_LEAST_NUMBERS = 6  # of a pose
TIME = re.compile(r"[0-9]+[-:./][0-9]+[-:./][0-9]+")


@dataclass(frozen=True)
class Row:
    """One line of numbers: its place in the text, the words before and behind them, labels where each has one."""

    line: int
    words: tuple[str, ...]
    numbers: tuple[float, ...]
    labels: tuple[str, ...] = ()
    behind: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rows:
    """The rows of a text that are alike, the line of names above them, and how many lines were none of them.

    `uneven` are rows below the first that have fewer numbers or more: one of a list that was not filled in.
    """

    rows: tuple[Row, ...]
    names: tuple[str, ...]
    others: int
    uneven: tuple[Row, ...] = ()

    @property
    def width(self) -> int:
        """How many numbers each row has."""
        return len(self.rows[0].numbers) if self.rows else 0


def rows_in(text: str) -> Rows:
    """Return the rows of the commonest width, and what stands above them; the text is gone through once."""
    found: list[Row] = []
    others: list[tuple[int, str]] = []
    for line, content in enumerate(text.splitlines(), start=1):
        bare = content.strip()
        if not bare:
            continue
        row = None if len(bare) > _LONGEST_LINE else _row(line, bare)
        if row is None or (not found and all(map(math.isnan, row.numbers))):
            others.append((line, bare))
        elif not _is_remark(bare):
            found.append(row)
    if not found:
        return _between_words([content for _, content in others])
    width = Counter(len(row.numbers) for row in found).most_common(1)[0][0]
    kept = tuple(row for row in found if len(row.numbers) == width)
    uneven = tuple(row for row in found if len(row.numbers) != width and row.line > kept[0].line)
    above = [content for line, content in others if line < kept[0].line]
    names = _names(above[-1]) if above else ()
    remarks = sum(_is_remark(content) for _, content in others)
    return Rows(kept, names, len(others) - remarks - bool(names) + len(found) - len(kept), uneven)


def _is_remark(line: str) -> bool:
    """Return whether a line is none of the table's; one that leaves its first field blank is."""
    return line.startswith(_COMMENTS) and not (line[0] == ";" and line.count(";") >= _LEAST_NUMBERS - 1)


def _between_words(lines: Sequence[str]) -> Rows:
    """Return the columns of numbers of a table that has words, times, remarks among them, as a log of a cell does.

    Its first line names every column; what names or files stand in a column of words are the rows' own.
    """
    nothing = Rows((), (), len(lines))
    if len(lines) < 2:
        return nothing
    style = style_of(lines[1])
    names, *cells = ([field.strip().strip("\"'").strip() for field in style.fields(line)] for line in lines)
    if style.separator is None or any(map(_is_number, names)) or any(len(row) != len(names) for row in cells):
        return nothing
    columns = list(zip(*cells, strict=True))
    numbers = [k for k, column in enumerate(columns) if all(map(_is_number, column))]
    named = [
        k for k, column in enumerate(columns) if len(set(column)) == len(column) and not TIME.search(column[0])
    ]
    words = [k for k in named if k not in numbers][:1]
    if len(numbers) < _LEAST_NUMBERS:
        return nothing
    rows = tuple(
        Row(number, tuple(row[k] for k in words), tuple(float(row[k]) for k in numbers))
        for number, row in enumerate(cells, start=2)
    )
    return Rows(rows, tuple(names[k] for k in (*words, *numbers)), 0)


def _row(line: int, text: str) -> Row | None:
    """Return the row that a line is, None where something stands between its numbers or there is none."""
    if "=" in text or ":" in text:
        pairs = _LABELLED.findall(text)
        if len(pairs) > 2:
            return Row(line, (), tuple(float(v) for _, v in pairs), tuple(name.lower() for name, _ in pairs))
    plain = text.translate(_BRACKETS).strip()
    fields = [field.strip() for field in style_of(plain).fields(plain)]
    if sum(map(_is_number, fields)) < 2 and not (
        len(fields) > 1 and "" in fields and (any(map(_is_number, fields)) or fields.count("") >= _LEAST_NUMBERS)
    ):
        fields = [field for field in re.split(r"[\s,;]+", plain) if field]
    counter = _COUNTER.match(fields[0]) if fields else None
    if counter:
        fields[0] = counter[1]
    first = next((k for k, field in enumerate(fields) if not field or _is_number(field)), len(fields))
    numbers = fields[first:]
    while len(numbers) > 2 and numbers[-1] and not _is_number(numbers[-1]):
        numbers.pop()  # a remark behind them
    if first > _MOST_WORDS or len(numbers) < 2 or not all(_is_number(f) or not f for f in numbers):
        return None
    behind = tuple(fields[first + len(numbers) :])
    return Row(line, tuple(fields[:first]), tuple(float(f) if f else math.nan for f in numbers), (), behind)


def _is_number(field: str) -> bool:
    return NUMBER.match(field) is not None or field.lower() in ("nan", "-nan")


def _names(line: str) -> tuple[str, ...]:
    """Return the names of columns that a line above the rows holds."""
    bare = line.lstrip("#/%!;- ").strip()
    separator = next((mark for mark in (";", "\t", ",") if mark in bare), None)
    return tuple(word.strip().strip("\"'").strip() for word in bare.split(separator)) if bare else ()


def counts_up(values: Sequence[float]) -> bool:
    """Return whether numbers are whole and each is one more than the one before."""
    return len(values) > 1 and all(v == int(v) for v in values) and all(b - a == 1 for a, b in pairwise(values))


def rises(values: Sequence[float]) -> bool:
    """Return whether each number is larger than the one before."""
    return len(values) > 1 and all(b > a for a, b in pairwise(values))
