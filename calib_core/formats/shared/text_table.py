"""Tables of numbers as text: preamble, header, any of the usual separators, decimal commas, blanks for NaN."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, repeat

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.shared.names import axis_of, unit_of
from calib_core.formats.shared.text_style import (
    BLANK_WORDS,
    NAN_WORDS,
    NUMBER,
    Style,
    decode_text,
    first_lines,
    style_of,
)
from calib_core.frames import FloatArray
from calib_core.messages import message

_BLOCK_BYTES = 4_000_000
_RUN = 3  # so many lines alike are the table
_COMMENTS = ("#", "//", "%")
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
    """

    values: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    preamble: tuple[str, ...]
    first_line: int


@dataclass(frozen=True)
class _Header:
    """What stands above the rows: names, units, and the lines before."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    preamble: tuple[str, ...]


@dataclass(frozen=True)
class _Head:
    """Where the rows begin (index of the line), how many fields each has, how they are written."""

    start: int
    width: int
    style: Style


def parse_numbers(data: bytes, where: str, width: int, example: str) -> FloatArray:
    """Return the numbers (N, width) of a text without a header; raises InputError with the line at fault."""
    table = parse_table(decode_text(data, where, example), where, example)
    if table.values.shape[1] != width:
        raise InputError(
            "{width} columns a line ({example})",
            "{width_other} in line {first_line}",
            "Write one point a line.",
            where,
            width=width,
            example=example,
            width_other=table.values.shape[1],
            first_line=table.first_line,
        )
    return table.values


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
    if ".#" in text or ",#" in text or "nan(" in text or "NaN(" in text or "NAN(" in text:
        text = _C_NAN.sub("nan", text)
    lines = first_lines(text)
    head = _head(lines)
    if head is None:
        raise InputError(
            "lines of numbers ({example})",
            "no line with a number",
            "Save the capture again.",
            where,
            example=example,
        )
    header = _header(lines[: head.start], head, where, first_line)
    offset = sum(len(line) + 1 for line in lines[: head.start])
    body = text[offset:]
    if head.style.comma:
        _require_one_decimal_mark(body, where, first_line + head.start)
    before = head.start + first_line - 1
    blocks: list[FloatArray] = []
    for block in _blocks(body):
        rows = block.removesuffix("\n").split("\n")
        blocks.append(_parse_lines(rows, head, before, where, example))
        before += len(rows)
    values = np.concatenate(blocks)
    if len(header.names) == head.width - 1:
        _require_empty_end(values, where, first_line + head.start)
        header = replace(header, names=(*header.names, ""))
    if not len(values):
        raise InputError(
            "lines of numbers ({example})",
            "no line with a number",
            "Save the capture again.",
            where,
            example=example,
        )
    return TextTable(values, header.names, header.units, header.preamble, first_line + head.start)


def _fields_of_row(line: str, style: Style) -> int:
    """Return the number of fields where all are numbers or blanks, with one at least that is none; else 0."""
    fields = [field.strip() for field in style.fields(line)]
    words = [field.lower() for field in fields]
    if not all(word in BLANK_WORDS or NUMBER.match(word) for word in words):
        return 0
    return len(fields) if any(word in NAN_WORDS or NUMBER.match(word) for word in words) else 0


def _head(lines: list[str]) -> _Head | None:
    """Return where the rows begin: at the first line like those of the first run of lines that are rows alike."""
    runs: dict[tuple[int, Style], tuple[int, int]] = {}  # of each kind of row: the first line, the longest run
    last: tuple[int, Style] | None = None
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


def _row_at(line: str) -> tuple[int, Style] | None:
    """Return the number of fields and their style where a line is a row of two columns or more."""
    style = style_of(line)
    width = _fields_of_row(line, style)
    return (width, style) if width > 1 else None


def _any_row(lines: list[str]) -> _Head | None:
    """Return the first line with a number in it, where none is a row of numbers alone: an error will name it."""
    for index, line in enumerate(lines):
        style = style_of(line)
        fields = style.fields(line)
        if not _is_comment(line) and any(NUMBER.match(f) or f.strip().lower() in NAN_WORDS for f in fields):
            return _Head(index, len(fields), style)
    return None


def _with_blank_rows(lines: list[str], start: int, width: int, style: Style) -> int:
    """Return where rows of blanks alone begin that stand before the first row with a number."""
    first = start
    while first and style.separator and _is_blank_row(lines[first - 1], width, style):
        first -= 1
    named = first and len(style.fields(lines[first - 1])) == width
    return first if not first or named else start


def _is_blank_row(line: str, width: int, style: Style) -> bool:
    fields = style.fields(line)
    return len(fields) == width and all(not field.strip() for field in fields)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENTS)


def _header(lines: list[str], head: _Head, where: str, first_line: int) -> _Header:
    """Return what stands above the rows: the columns' names, in the last line as wide as a row that names axes.

    Raises
    ------
    InputError
        If a line between names and rows has numbers: it is a row that was damaged.
    """
    above = [index for index, line in enumerate(lines) if line.strip()]
    for place in range(len(above) - 1, -1, -1):
        names = _named(lines[above[place]], head)
        if not any(map(_is_axis, names)) or any(map(NUMBER.match, names)):
            continue
        below = above[place + 1 :]
        units = _named(lines[below[0]], head) if below else ()
        if not any(unit_of(field) for field in units) or any(map(NUMBER.match, units)):
            units = ()
        for index in below[1:] if units else below:
            _require_no_row(lines[index], head, where, first_line + index, True)
        return _Header(names, units, tuple(lines[index] for index in above[:place]))
    if not above:
        return _Header((), (), ())
    last = lines[above[-1]]
    _require_same_separator(last, head, where, first_line + above[-1])
    _require_no_row(last, head, where, first_line + above[-1], False)
    _require_no_short_header(last, head, where, first_line + above[-1])
    apart = head.style.separator is None and above[-1] < len(lines) - 1  # a remark, an empty line behind it
    names = () if _is_comment(last) or apart else _named(last, head)
    kept = above[:-1] if names else above
    return _Header(names, (), tuple(lines[index] for index in kept))


def _require_same_separator(line: str, head: _Head, where: str, number: int) -> None:
    """Refuse rows cut by commas under a header cut by ; or tabs: these are decimal commas of a row cut off."""
    style = style_of(line)
    if head.style.separator == "," and style.separator in (";", "\t") and any(map(_is_axis, style.fields(line))):
        raise InputError(
            "rows cut by {separator!r}, like the header in line {number}",
            "commas alone",
            "Copy or export the file again.",
            where,
            separator=style.separator,
            number=number,
        )


def _is_axis(name: str) -> bool:
    return axis_of(name)[0] is not None


def _require_no_short_header(line: str, head: _Head, where: str, number: int) -> None:
    """Refuse a line above the rows that names axes but not each column; a remark may name x, y and z alone."""
    names = [name for name in _split_names(line, head) if name]
    axes = [axis for name in names if (axis := axis_of(name)[0])]
    if not axes or len(names) < 2 or (_is_comment(line) and names == axes == ["x", "y", "z"]):
        return
    got = message("{count} in line {number}: {line}", count=len(names), number=number, line=_shown(line))
    raise InputError("a name for each of {width} columns", got, "Correct the header.", where, width=head.width)


def _require_no_row(line: str, head: _Head, where: str, number: int, named: bool) -> None:
    """Refuse a line above the rows that looks like one of them: its numbers must not be lost in silence."""
    words = [word for word in re.split(r"[;,\t| ]+", line.strip()) if word]
    alike = len(head.style.fields(line)) == head.width and any(map(NUMBER.match, head.style.fields(line)))
    count = not named and len(words) == 1 and words[0].isdecimal()  # of points, as XYZ and PTS begin
    if not _is_comment(line) and (alike or (not count and all(map(NUMBER.match, words)))):
        raise InputError(
            "{width} numbers in a line, like the rows below",
            "{line} in line {number}",
            "Correct this line, or begin it with # where it is a remark.",
            where,
            width=head.width,
            line=_shown(line),
            number=number,
        )


def _named(line: str, head: _Head) -> tuple[str, ...]:
    """Return the fields of a header, stripped; none where it has not as many as a row."""
    fields = _split_names(line, head)
    if head.style.separator is None and len(fields) != head.width:
        fields = [field.strip() for field in re.split(r"\s{2,}|\t|,|;", line.strip().lstrip("#/%! "))]
    while len(fields) > head.width and not fields[-1]:
        fields.pop()
    named = any(map(_is_axis, fields))
    short = named and len(fields) == head.width - 1  # rows end in a separator, the header does not
    return tuple(fields) if (len(fields) == head.width or short) and any(fields) else ()


def _split_names(line: str, head: _Head) -> list[str]:
    stripped = line.strip().lstrip("#/%! ") if _is_comment(line) else line
    return [field.strip().strip('"').strip() for field in stripped.split(head.style.separator)]


def _require_empty_end(values: FloatArray, where: str, line: int) -> None:
    """Refuse a header with a name fewer than there are columns, unless the rows end in a separator."""
    if not np.isnan(values[:, -1]).all():
        raise InputError(
            "a name for each of {width} columns",
            "{width_other} in the header above line {line}",
            "Correct the header.",
            where,
            width=values.shape[1],
            width_other=values.shape[1] - 1,
            line=line,
        )


def _require_one_decimal_mark(body: str, where: str, first_line: int) -> None:
    """Refuse decimal points and decimal commas in one table: one of them would be misread."""
    if "," not in body or "." not in body:
        return
    place = min(body.find(","), body.find(".")), max(body.find(","), body.find("."))
    line = body.count("\n", 0, place[1]) + first_line
    raise InputError(
        "decimal points or decimal commas",
        "both, first in line {line}",
        "Export the file again with one of them.",
        where,
        line=line,
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
        blanks = "" in fields
        numbers = [float(field) if field else np.nan for field in fields] if blanks else list(map(float, fields))
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
        even = {head.width}.issuperset(map(len, rows))
        fields = list(chain.from_iterable(rows))
        joined = " ".join(lines)
        fields = [field.replace(",", ".") for field in fields] if head.style.comma else fields
    else:
        even = {head.width - 1}.issuperset(map(str.count, lines, repeat(separator)))
        joined = separator.join(lines)
        fields = (joined.replace(",", ".") if head.style.comma and separator != "," else joined).split(separator)
    if not even or "_" in joined or '"' in joined or not joined.isascii():
        raise ValueError  # float() would take 1_0 for ten, and digits of other scripts
    return fields


def _parse_with_care(lines: list[str], head: _Head, before: int, where: str, example: str) -> FloatArray:
    """Parse line by line: skips blank lines and comments, takes blanks for NaN, names the line that is wrong."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=before + 1):
        if not line.strip() or _is_comment(line):
            continue
        fields = head.style.fields(line)
        if len(fields) != head.width:
            raise InputError(
                "{width} columns in every line",
                "{count} in line {number}: {line}",
                "If the file was cut off, copy it again; otherwise correct this line.",
                where,
                width=head.width,
                count=len(fields),
                number=number,
                line=_shown(line),
            )
        row: list[float] = []
        for field in fields:
            word = field.strip()
            if NUMBER.match(word):
                row.append(float(word))
            elif word.lower() in BLANK_WORDS:
                row.append(np.nan)
            else:
                raise InputError(
                    "numbers ({example})",
                    "{word} in line {number}",
                    "Correct this line.",
                    where,
                    example=example,
                    word=_shown(word),
                    number=number,
                )
        rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, head.width)


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:39] + "…")
