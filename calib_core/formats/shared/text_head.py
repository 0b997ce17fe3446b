"""What stands above a text's rows of numbers: where they begin, how they are written, the columns' names."""

import re
from dataclasses import dataclass

from calib_core.errors import InputError
from calib_core.formats.shared.names import axis_of, unit_of
from calib_core.formats.shared.text_style import BLANK_WORDS, NAN_WORDS, NUMBER, Style, style_of
from calib_core.messages import message

_RUN = 3  # so many lines alike are the table
_COMMENTS = ("#", "//", "%")


@dataclass(frozen=True)
class Header:
    """What stands above the rows: names, units, and the lines before."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    preamble: tuple[str, ...]


@dataclass(frozen=True)
class Head:
    """Where the rows begin (index of the line), how many fields each has, how they are written."""

    start: int
    width: int
    style: Style


def _fields_of_row(line: str, style: Style) -> int:
    """Return the number of fields where all are numbers or blanks, with one at least that is none; else 0."""
    fields = [field.strip() for field in style.fields(line)]
    words = [field.lower() for field in fields]
    if not all(word in BLANK_WORDS or NUMBER.match(word) for word in words):
        return 0
    return len(fields) if any(word in NAN_WORDS or NUMBER.match(word) for word in words) else 0


def head_of(lines: list[str]) -> Head | None:
    """Return where the rows begin: at the first line like those of the first run of lines that are rows alike."""
    runs: dict[tuple[int, Style], tuple[int, int]] = {}  # of each kind of row: the first line, the longest run
    last: tuple[int, Style] | None = None
    count = 0
    for index, line in enumerate(lines):
        if not line.strip() or is_comment(line):
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
    return Head(_with_blank_rows(lines, start, width, style), width, style)


def _row_at(line: str) -> tuple[int, Style] | None:
    """Return the number of fields and their style where a line is a row of two columns or more."""
    style = style_of(line)
    width = _fields_of_row(line, style)
    return (width, style) if width > 1 else None


def _any_row(lines: list[str]) -> Head | None:
    """Return the first line with a number, where none is a row of them alone (an error names it), or none."""
    for index, line in enumerate(lines):
        style = style_of(line)
        fields = style.fields(line)
        if not is_comment(line) and any(NUMBER.match(f) or f.strip().lower() in NAN_WORDS for f in fields):
            return Head(index, len(fields), style)
        rows = [row for row in lines[index + 1 :] if row.strip()]
        blank = all(_is_blank_row(row, len(fields), style) for row in rows)
        if blank and {"x", "z"}.issubset(axis_of(f)[0] for f in fields):  # nothing came back to the scanner
            return Head(index + 1, len(fields), style)
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


def is_comment(line: str) -> bool:
    """Return whether a line is a remark."""
    return line.lstrip().startswith(_COMMENTS)


def header_of(lines: list[str], head: Head, where: str, first_line: int) -> Header:
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
        return Header(names, units, tuple(lines[index] for index in above[:place]))
    if not above:
        return Header((), (), ())
    last = lines[above[-1]]
    _require_same_separator(last, head, where, first_line + above[-1])
    _require_no_row(last, head, where, first_line + above[-1], False)
    _require_no_short_header(last, head, where, first_line + above[-1])
    apart = head.style.separator is None and above[-1] < len(lines) - 1  # a remark, an empty line behind it
    names = () if is_comment(last) or apart else _named(last, head)
    kept = above[:-1] if names else above
    return Header(names, (), tuple(lines[index] for index in kept))


def _require_same_separator(line: str, head: Head, where: str, number: int) -> None:
    """Refuse rows cut by commas under a header cut by ; or tabs: these are decimal commas of a row cut off."""
    style = style_of(line)
    if head.style.separator == "," and style.separator in (";", "\t") and any(map(_is_axis, style.fields(line))):
        need = "rows cut by {separator!r}, like the header in line {number}"
        to_do = "Copy or export it again."
        raise InputError(need, "commas alone", to_do, where, separator=style.separator, number=number)


def _is_axis(name: str) -> bool:
    return axis_of(name)[0] is not None


def _require_no_short_header(line: str, head: Head, where: str, number: int) -> None:
    """Refuse a line above the rows that names axes but not each column; a remark may name x, y and z alone."""
    names = [name for name in _split_names(line, head) if name]
    axes = [axis for name in names if (axis := axis_of(name)[0])]
    if not axes or len(names) < 2 or (is_comment(line) and names == axes == ["x", "y", "z"]):
        return
    got = message("{count} in line {number}: {line}", count=len(names), number=number, line=shown_line(line))
    raise InputError("a name for each of {width} columns", got, "Correct it.", where, width=head.width)


def _require_no_row(line: str, head: Head, where: str, number: int, named: bool) -> None:
    """Refuse a line above the rows that looks like one of them: its numbers must not be lost in silence."""
    words = [word for word in re.split(r"[;,\t| ]+", line.strip()) if word]
    alike = len(head.style.fields(line)) == head.width and any(map(NUMBER.match, head.style.fields(line)))
    count = not named and len(words) == 1 and words[0].isdecimal()  # of points, as XYZ and PTS begin
    if not is_comment(line) and (alike or (not count and all(map(NUMBER.match, words)))):
        raise InputError(
            "{width} numbers in a line, like the rows below",
            "{word} in line {number}",
            "Correct this line, or begin it with # where it is a remark.",
            where,
            width=head.width,
            word=shown_line(line),
            number=number,
        )


def _named(line: str, head: Head) -> tuple[str, ...]:
    """Return the fields of a header, stripped; none where it has not as many as a row."""
    fields = _split_names(line, head)
    if head.style.separator is None and len(fields) != head.width:
        fields = [field.strip() for field in re.split(r"\s{2,}|\t|,|;", line.strip().lstrip("#/%! "))]
    while len(fields) > head.width and not fields[-1]:
        fields.pop()
    named = any(map(_is_axis, fields))
    short = named and len(fields) == head.width - 1  # rows end in a separator, the header does not
    return tuple(fields) if (len(fields) == head.width or short) and any(fields) else ()


def _split_names(line: str, head: Head) -> list[str]:
    stripped = line.strip().lstrip("#/%! ") if is_comment(line) else line
    return [field.strip().strip('"').strip() for field in stripped.split(head.style.separator)]


def shown_line(text: str) -> str:
    """Return a line or a word as messages show it, cut where it is long."""
    return repr(text if len(text) <= 40 else text[:39] + "…")
