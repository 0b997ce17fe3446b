"""Tables of numbers as text: any of the usual separators, an optional header, blanks where nothing came back."""

import re
from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import FloatArray

_BLOCK_BYTES = 4_000_000
_SEPARATORS = (";", "\t", ",")
_COMMENTS = ("#", "//", "%")
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*\Z")
_NAN = {"nan", "-nan", "+nan", "inf", "-inf", "+inf", "null", "none"}
_BLANK = {"", "-", *_NAN}


def parse_table(data: bytes, where: str, columns: Sequence[int], example: str) -> FloatArray:
    """Return the numbers of a text file; NaN where a field is blank.

    Parameters
    ----------
    data : bytes
        The file.
    where : str
        Its name, for messages.
    columns : sequence of int
        How many columns are meant, the possible numbers.
    example : str
        What a good line looks like, for messages.

    Returns
    -------
    (N, C) with C one of `columns`.

    Raises
    ------
    InputError
        With the line that is at fault.
    """
    text = _decode(data, where, example)
    lines_before, width, separator = 0, 0, None
    blocks: list[FloatArray] = []
    for block in _blocks(text):
        lines = block.splitlines()
        if not width:
            start = _first_row(lines)
            if start == len(lines):
                lines_before += start
                continue
            separator = _separator(lines[start])
            width = len(lines[start].split(separator))
            if width not in columns:
                raise InputError(
                    f"{_counts(columns)} columns a line ({example})",
                    f"{width} in line {lines_before + start + 1}",
                    "Write one point a line.",
                    where,
                )
            if start:
                _require_column_order(lines[start - 1], where, example)
            lines, lines_before = lines[start:], lines_before + start
        lines = _decimal_points("\n".join(lines), separator).split("\n") if separator in (";", "\t") else lines
        blocks.append(_parse_lines(lines, separator, width, lines_before, where, example))
        lines_before += len(lines)
    if not blocks:
        raise InputError(
            f"lines of numbers ({example})", "no line with a number", "Save the capture again.", where
        )
    return np.concatenate(blocks)


def _decode(data: bytes, where: str, example: str) -> str:
    if not data.strip():
        raise InputError(f"lines of numbers ({example})", "an empty file", "Save the capture again.", where)
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(
            f"lines of numbers as text ({example})", "bytes that are no text", "Export it as text.", where
        )
    return text


def _counts(columns: Sequence[int]) -> str:
    few = len(columns) < 4
    return " or ".join(map(str, columns)) if few else f"{min(columns)} to {max(columns)}"


def _blocks(text: str) -> Iterator[str]:
    """Cut a long text at line ends, so that the memory for its fields stays small."""
    start = 0
    while start < len(text):
        end = text.find("\n", start + _BLOCK_BYTES)
        end = len(text) if end < 0 else end + 1
        yield text[start:end]
        start = end


def _first_row(lines: list[str]) -> int:
    """Return the index of the first line with a number in it: what stands before is a header."""
    for index, line in enumerate(lines):
        if line.lstrip().startswith(_COMMENTS):
            continue
        separator = _separator(line)
        fields = _decimal_points(line, separator).split(separator)
        if any(_NUMBER.match(field) or field.strip().lower() in _NAN for field in fields):
            return index
    return len(lines)


def _separator(line: str) -> str | None:
    """Return the separator that a line uses; None is any run of spaces."""
    return next((mark for mark in _SEPARATORS if mark in line), None)


def _decimal_points(text: str, separator: str | None) -> str:
    """Return the text with points for decimal commas, which stand only where something else separates."""
    return text.replace(",", ".") if separator in (";", "\t") else text


def _require_column_order(header: str, where: str, example: str) -> None:
    """Refuse a header that names x, y, z in another order, or metres: the numbers would be misread silently."""
    names = [name.strip().strip('"').lower() for name in re.split(r"[,;\t ]+", header.lstrip("#/% ")) if name]
    expected = [name.split("_")[0] for name in example.split(",")]
    axes = [name.split("_")[0] for name in names if re.fullmatch(r"[xyz](_\w+)?", name)]
    metres = [name for name in names if re.fullmatch(r"[xyz]_m", name)]
    if metres:
        raise InputError(
            "coordinates in millimetres", f"the column {metres[0]}, in metres", "Multiply them by 1000.", where
        )
    if axes and axes != [name for name in expected if name in "xyz"]:
        raise InputError(
            f"the columns {example}",
            f"the header {header.strip()[:60]!r}",
            "Write the columns in that order.",
            where,
        )


def _parse_lines(
    lines: list[str], separator: str | None, width: int, lines_before: int, where: str, example: str
) -> FloatArray:
    try:
        fields = _fields(lines, separator, width)
        # Blank fields come often (",\n"): they are worth the quick way too.
        numbers = [float(field or "nan") for field in fields] if "" in fields else list(map(float, fields))
        values = np.array(numbers).reshape(-1, width)
    except ValueError:
        values = _parse_with_care(lines, separator, width, lines_before, where, example)
    values[~np.isfinite(values)] = np.nan
    return values


def _fields(lines: list[str], separator: str | None, width: int) -> list[str]:
    """Return the fields of all lines; raises ValueError where they need care."""
    if separator is None:
        rows = [line.split() for line in lines]
        even = all(len(row) == width for row in rows)
        fields = list(chain.from_iterable(rows))
    else:
        even = all(line.count(separator) == width - 1 for line in lines)
        fields = separator.join(lines).split(separator)
    if not even or "_" in " ".join(lines):
        raise ValueError  # float() would take 1_0 for ten
    return fields


def _parse_with_care(
    lines: list[str], separator: str | None, width: int, lines_before: int, where: str, example: str
) -> FloatArray:
    """Parse line by line: skips blank lines and comments, takes blanks for NaN, names the line that is wrong."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=lines_before + 1):
        if not line.strip() or line.lstrip().startswith(_COMMENTS):
            continue
        fields = line.split(separator)
        while len(fields) > width and not fields[-1].strip():
            fields.pop()
        if len(fields) != width:
            raise InputError(
                f"{width} columns in every line",
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
    return np.array(rows, dtype=float).reshape(-1, width)


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:39] + "…")
