"""Tables of numbers as text: preamble, header, any of the usual separators, decimal commas, blanks for NaN."""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.shared.names import axis_of, unit_of
from calib_core.frames import FloatArray

_BLOCK_BYTES = 4_000_000
_HEAD_LINES = 2000  # where the table must have begun
_RUN = 3  # so many lines alike are the table
_SEPARATORS = (";", "\t", ",", "|")
_COMMENTS = ("#", "//", "%")
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*\Z")
_COMMA_NUMBER = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?\Z")
_NAN = {"nan", "-nan", "+nan", "inf", "-inf", "+inf", "infinity", "-infinity", "null", "none"}
_BLANK = {"", "-", "--", "---", "*", "n/a", "#n/a", "na", "invalid", *_NAN}
_C_NAN = re.compile(r"[+-]?(1[.,]#(IND|QNAN|SNAN|INF)0*|nan\((ind|snan)\))", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class TextTable:
    """A table of a text file, and what stands before it.

    Parameters
    ----------
    values : (N, C)
        NaN where a field is blank.
    names : tuple of str
        The fields of the header, as they stand; none where there is no header.
    units : tuple of str
        The fields of a line of units under it.
    preamble : tuple of str
        The lines before the header.
    first_line : int
        The number of the first row's line, from 1.
    decimal_comma : bool
    """

    values: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    preamble: tuple[str, ...]
    first_line: int
    decimal_comma: bool


@dataclass(frozen=True)
class _Style:
    """How the fields of a table are written; separator None is any run of spaces."""

    separator: str | None
    comma: bool
    quoted: bool

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line, with points for decimal commas."""
        if self.quoted and self.separator is not None:
            found = next(csv.reader([line], delimiter=self.separator), [])
        else:
            found = line.split(self.separator)
        return [field.replace(",", ".") for field in found] if self.comma else found


@dataclass(frozen=True)
class _Head:
    """Where the rows begin (index of the line), how many fields each has, how they are written."""

    start: int
    width: int
    style: _Style


def parse_numbers(data: bytes, where: str, width: int, example: str) -> FloatArray:
    """Return the numbers (N, width) of a text without a header; raises InputError with the line at fault."""
    table = parse_table(decode_text(data, where, example), where, example)
    if table.values.shape[1] != width:
        raise InputError(
            f"{width} columns a line ({example})",
            f"{table.values.shape[1]} in line {table.first_line}",
            "Write one point a line.",
            where,
        )
    return table.values


def decode_text(data: bytes, where: str, example: str) -> str:
    """Return the text of a file in UTF-8, UTF-16 or Windows' Latin; raises InputError where it is none."""
    if not data.strip():
        raise InputError(f"lines of numbers ({example})", "an empty file", "Save the capture again.", where)
    text = _decoded(data)
    if text is None:
        raise InputError(
            f"lines of numbers as text ({example})", "bytes that are no text", "Export it as text.", where
        )
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def looks_like_text(data: bytes) -> bool:
    """Return whether the first bytes of a file are text."""
    return bool(data.strip()) and _decoded(data[:4000], cut=True) is not None


def _decoded(data: bytes, cut: bool = False) -> str | None:
    ways = ["utf-8-sig", "cp1252"]
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        ways = ["utf-16"]
    elif data[1:40:2].count(0) > 15:
        ways = ["utf-16-le"]
    elif data[0:40:2].count(0) > 15:
        ways = ["utf-16-be"]
    for way in ways:
        try:
            text = data.decode(way, errors="ignore" if cut and way != "cp1252" else "strict")
        except UnicodeDecodeError:
            continue
        return None if "\0" in text or (way == "cp1252" and _is_binary(text)) else text
    return None


def _is_binary(text: str) -> bool:
    head = text[:4000]
    return sum(ord(mark) < 32 and mark not in "\t\r\n\f" for mark in head) > 0


def parse_table(text: str, where: str, example: str, first_line: int = 1) -> TextTable:
    """Return the table of a text, from the first lines that are rows of numbers to the end.

    Parameters
    ----------
    text : str
        As `decode_text` gives it.
    where : str
        The file's name, for messages.
    example : str
        What a good line looks like, for messages.
    first_line : int
        The number of the text's first line in its file.

    Raises
    ------
    InputError
        With the line that is at fault.
    """
    if "#" in text or "nan(" in text.lower():
        text = _C_NAN.sub("nan", text)
    lines = _first_lines(text)
    head = _head(lines)
    if head is None:
        raise InputError(
            f"lines of numbers ({example})", "no line with a number", "Save the capture again.", where
        )
    names, units, preamble = _header(lines[: head.start], head)
    offset = sum(len(line) + 1 for line in lines[: head.start])
    body = text[offset:]
    if head.style.comma:
        _require_one_decimal_mark(body, head.style, where, first_line + head.start)
    before = head.start + first_line - 1
    blocks: list[FloatArray] = []
    for block in _blocks(body):
        rows = block.removesuffix("\n").split("\n")
        blocks.append(_parse_lines(rows, head, before, where, example))
        before += len(rows)
    values = np.concatenate(blocks)
    if not len(values):
        raise InputError(
            f"lines of numbers ({example})", "no line with a number", "Save the capture again.", where
        )
    return TextTable(values, names, units, preamble, first_line + head.start, head.style.comma)


def _first_lines(text: str) -> list[str]:
    """Return lines until the table must have begun."""
    lines: list[str] = []
    at = 0
    while at < len(text) and len(lines) < _HEAD_LINES:
        end = text.find("\n", at)
        end = len(text) if end < 0 else end
        lines.append(text[at:end])
        at = end + 1
    return lines


def _style(line: str) -> _Style:
    """Return how a line's fields are written."""
    words = line.split()
    quoted = '"' in line
    separator = next((mark for mark in _SEPARATORS if mark in line), None)
    if separator == "," and len(words) > 1 and all(_COMMA_NUMBER.match(word) for word in words):
        return _Style(None, True, False)
    comma = separator in (";", "\t") or (quoted and separator == "," and _quotes_decimal_commas(line))
    return _Style(separator, comma, quoted)


def _quotes_decimal_commas(line: str) -> bool:
    return re.search(r'"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*"', line) is not None


def _fields_of_row(line: str, style: _Style) -> int:
    """Return the number of fields where all are numbers or blanks, with one at least that is none; else 0."""
    fields = [field.strip() for field in style.fields(line)]
    words = [field.lower() for field in fields]
    if not all(word in _BLANK or _NUMBER.match(word) for word in words):
        return 0
    return len(fields) if any(word in _NAN or _NUMBER.match(word) for word in words) else 0


def _head(lines: list[str]) -> _Head | None:
    """Return where the rows begin: at the first line like those of the first run of lines that are rows alike."""
    runs: dict[tuple[int, _Style], tuple[int, int]] = {}  # of each kind of row: the first line, the longest run
    last: tuple[int, _Style] | None = None
    count = 0
    for index, line in enumerate(lines):
        if not line.strip() or _is_comment(line):
            continue
        found = _row_at(line)
        count = count + 1 if found == last else 1
        last = found
        if found is None:
            continue
        first, longest = runs.get(found, (index, 0))
        runs[found] = (first, max(longest, count))
        if count == _RUN:
            break
    if not runs:
        return _any_row(lines)
    (width, style), (start, _) = max(runs.items(), key=lambda run: run[1][1])
    return _Head(_with_blank_rows(lines, start, width, style), width, style)


def _row_at(line: str) -> tuple[int, _Style] | None:
    """Return the number of fields and their style where a line is a row of two columns or more."""
    style = _style(line)
    width = _fields_of_row(line, style)
    return (width, style) if width > 1 else None


def _any_row(lines: list[str]) -> _Head | None:
    """Return the first line with a number in it, where none is a row of numbers alone: an error will name it."""
    for index, line in enumerate(lines):
        style = _style(line)
        fields = style.fields(line)
        if not _is_comment(line) and any(_NUMBER.match(f) or f.strip().lower() in _NAN for f in fields):
            return _Head(index, len(fields), style)
    return None


def _with_blank_rows(lines: list[str], start: int, width: int, style: _Style) -> int:
    """Return where rows of blanks alone begin that stand before the first row with a number."""
    first = start
    while first and style.separator and _is_blank_row(lines[first - 1], width, style):
        first -= 1
    named = first and len(style.fields(lines[first - 1])) == width
    return first if not first or named else start


def _is_blank_row(line: str, width: int, style: _Style) -> bool:
    fields = style.fields(line)
    return len(fields) == width and all(not field.strip() for field in fields)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENTS)


def _header(lines: list[str], head: _Head) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return names and units of the columns, and the lines before; names stand in a line as wide as a row."""
    above = [line for line in lines if line.strip()]
    if not above:
        return (), (), ()
    last = _named(above[-1], head)
    unheard = _is_comment(above[-1]) and all(axis_of(field)[0] is None for field in last)
    if not last or unheard or any(_NUMBER.match(field) for field in last):
        return (), (), tuple(above)
    if len(above) > 1 and all(not field or unit_of(field) for field in last):
        names = _named(above[-2], head)
        if names:
            return names, last, tuple(above[:-2])
    return last, (), tuple(above[:-1])


def _named(line: str, head: _Head) -> tuple[str, ...]:
    """Return the fields of a header, stripped; none where it has not as many as a row."""
    stripped = line.strip().lstrip("#/%! ") if _is_comment(line) else line
    fields = [field.strip().strip('"').strip() for field in stripped.split(head.style.separator)]
    if head.style.separator is None and len(fields) != head.width:
        fields = [field.strip() for field in re.split(r"\s{2,}|\t|,|;", stripped.strip())]
    while len(fields) > head.width and not fields[-1]:
        fields.pop()
    if len(fields) == head.width - 1 and head.style.separator:
        fields.append("")  # rows end in a separator, the header does not
    return tuple(fields) if len(fields) == head.width and any(fields) else ()


def _require_one_decimal_mark(body: str, style: _Style, where: str, first_line: int) -> None:
    """Refuse decimal points and decimal commas in one table: one of them would be misread."""
    if "," not in body or "." not in body:
        return
    place = min(body.find(","), body.find(".")), max(body.find(","), body.find("."))
    line = body.count("\n", 0, place[1]) + first_line
    raise InputError(
        "decimal points or decimal commas",
        f"both, first in line {line}",
        "Export the file again with one of them.",
        where,
    )


def _blocks(text: str) -> Iterator[str]:
    """Cut a long text at line ends, so that the memory for its fields stays small."""
    start = 0
    while start < len(text):
        end = text.find("\n", start + _BLOCK_BYTES)
        end = len(text) if end < 0 else end + 1
        yield text[start:end]
        start = end


def _parse_lines(lines: list[str], head: _Head, before: int, where: str, example: str) -> FloatArray:
    try:
        fields = _fields(lines, head)
        # Blank fields come often (",\n"): they are worth the quick way too.
        numbers = [float(field or "nan") for field in fields] if "" in fields else list(map(float, fields))
        values = np.array(numbers).reshape(-1, head.width)
    except ValueError:
        values = _parse_with_care(lines, head, before, where, example)
    values[~np.isfinite(values)] = np.nan
    return values


def _fields(lines: Sequence[str], head: _Head) -> list[str]:
    """Return the fields of all lines; raises ValueError where they need care."""
    separator = head.style.separator
    if separator is None:
        rows = [line.split() for line in lines]
        even = all(len(row) == head.width for row in rows)
        fields = list(chain.from_iterable(rows))
        joined = " ".join(lines)
        fields = [field.replace(",", ".") for field in fields] if head.style.comma else fields
    else:
        even = all(line.count(separator) == head.width - 1 for line in lines)
        joined = separator.join(lines)
        fields = (joined.replace(",", ".") if head.style.comma and separator != "," else joined).split(separator)
    if not even or "_" in joined or '"' in joined:
        raise ValueError  # float() would take 1_0 for ten
    return fields


def _parse_with_care(lines: list[str], head: _Head, before: int, where: str, example: str) -> FloatArray:
    """Parse line by line: skips blank lines and comments, takes blanks for NaN, names the line that is wrong."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=before + 1):
        if not line.strip() or _is_comment(line):
            continue
        fields = head.style.fields(line)
        while len(fields) > head.width and not fields[-1].strip():
            fields.pop()
        if len(fields) != head.width:
            raise InputError(
                f"{head.width} columns in every line",
                f"{len(fields)} in line {number}: {_shown(line)}",
                "If the file was cut off, copy it again; otherwise correct this line.",
                where,
            )
        row: list[float] = []
        for field in fields:
            word = field.strip()
            if _NUMBER.match(word):
                row.append(float(word))
            elif word.lower() in _BLANK:
                row.append(np.nan)
            else:
                raise InputError(
                    f"numbers ({example})", f"{_shown(word)} in line {number}", "Correct this line.", where
                )
        rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, head.width)


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:39] + "…")
