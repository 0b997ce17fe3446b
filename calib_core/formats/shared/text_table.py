"""Tables of numbers as text: preamble, header, any of the usual separators, decimal commas, blanks for NaN."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, repeat

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.shared.names import is_label
from calib_core.formats.shared.text_head import Head, head_of, header_of, is_comment, shown_line
from calib_core.formats.shared.text_style import BLANK_WORDS, NUMBER, decode_text, first_lines
from calib_core.frames import FloatArray

_BLOCK_BYTES = 4_000_000
_END_CHARACTERS, _RUN = 4000, 8
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


def parse_numbers(data: bytes, where: str, width: int, example: str) -> FloatArray:
    """Return the numbers (N, width) of a text without a header; raises InputError with the line at fault."""
    table = parse_table(decode_text(data, where, example), where, example)
    if table.values.shape[1] != width:
        raise InputError(
            "{width} columns a line ({example})",
            "{word} in line {number}",
            "Write one point a line.",
            where,
            width=width,
            example=example,
            word=table.values.shape[1],
            number=table.first_line,
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
    head = head_of(lines)
    if head is None:
        to_do = "Copy or export it again."
        raise InputError("lines of numbers ({example})", "no line with a number", to_do, where, example=example)
    header = header_of(lines[: head.start], head, where, first_line)
    offset = sum(len(line) + 1 for line in lines[: head.start])
    body = text[offset:]
    if head.style.comma:
        _require_one_decimal_mark(body, where, first_line + head.start)
    _require_whole_end(body, head, where, first_line + head.start)
    labels = frozenset(column for column, name in enumerate(header.names) if is_label(name))
    before = head.start + first_line - 1
    blocks: list[FloatArray] = [np.empty((0, head.width))]  # a header alone: nothing came back
    for block in _blocks(body):
        rows = block.removesuffix("\n").split("\n")
        blocks.append(_parse_lines(rows, head, labels, before, where, example))
        before += len(rows)
    values = np.concatenate(blocks)
    if len(header.names) == head.width - 1:
        _require_empty_end(values, where, first_line + head.start)
        header = replace(header, names=(*header.names, ""))
    return TextTable(values, header.names, header.units, header.preamble, first_line + head.start)


def _require_empty_end(values: FloatArray, where: str, line: int) -> None:
    """Refuse a header with a name fewer than there are columns, unless the rows end in a separator."""
    if not np.isnan(values[:, -1]).all():
        raise InputError(
            "a name for each of {width} columns",
            "{width_other} in the header above line {line}",
            "Correct it.",
            where,
            width=values.shape[1],
            width_other=values.shape[1] - 1,
            line=line,
        )


def _require_whole_end(body: str, head: Head, where: str, first_line: int) -> None:
    """Refuse a last line without an end whose last number has fewer decimals than all before: it was cut off."""
    *before, last = body[-_END_CHARACTERS:].split("\n")
    end = last.strip() and head.style.fields(last)[-1].strip()  # a blank was not measured
    decimals = [_decimals(line, head) for line in before[1:] if line.strip()]
    if end and len(decimals) > _RUN and len(set(decimals)) == 1 and _decimals(last, head) < decimals[0]:
        raise InputError(
            "a last line as whole as those before",
            "{line} in line {number}",
            "If the file was cut off, copy it again; otherwise correct this line.",
            where,
            line=shown_line(last),
            number=first_line + body.count("\n"),
        )


def _decimals(line: str, head: Head) -> int:
    return len(head.style.fields(line)[-1].strip().partition(".")[2])


def _require_one_decimal_mark(body: str, where: str, first_line: int) -> None:
    """Refuse decimal points and decimal commas in one table: one of them would be misread."""
    if "," not in body or "." not in body:
        return
    place = min(body.find(","), body.find(".")), max(body.find(","), body.find("."))
    line = body.count("\n", 0, place[1]) + first_line
    to_do = "Export the file again with one of them."
    raise InputError("decimal points or decimal commas", "both, first in line {line}", to_do, where, line=line)


def _blocks(text: str) -> Iterator[str]:
    """Cut a long text at line ends, so that the memory for its fields stays small."""
    start = 0
    while start < len(text):
        end = text.find("\n", start + _BLOCK_BYTES)
        end = len(text) if end < 0 else end + 1
        yield text[start:end]
        start = end


def _parse_lines(
    lines: list[str], head: Head, labels: frozenset[int], before: int, where: str, example: str
) -> FloatArray:
    try:
        fields = _fields(lines, head)
        # Blank fields come often (",\n"): they are worth the quick way too.
        blanks = "" in fields
        numbers = [float(field) if field else np.nan for field in fields] if blanks else list(map(float, fields))
        values = np.array(numbers).reshape(-1, head.width)
    except ValueError:
        values = _parse_with_care(lines, head, labels, before, where, example)
    values[~np.isfinite(values)] = np.nan
    return values


def _fields(lines: Sequence[str], head: Head) -> list[str]:
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


def _parse_with_care(
    lines: list[str], head: Head, labels: frozenset[int], before: int, where: str, example: str
) -> FloatArray:
    """Parse line by line: skips blank lines and comments, takes blanks for NaN, names the line that is wrong.

    Columns of labels, as surveyors' points have them, may have words.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=before + 1):
        if not line.strip() or is_comment(line):
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
                line=shown_line(line),
            )
        row: list[float] = []
        for column, field in enumerate(fields):
            word = field.strip()
            if NUMBER.match(word):
                row.append(float(word))
            elif word.lower() in BLANK_WORDS or column in labels:
                row.append(np.nan)
            else:
                got = "{word} in line {number}"
                to_do = "Correct this line."
                need = "numbers ({example})"
                raise InputError(need, got, to_do, where, example=example, word=shown_line(word), number=number)
        rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, head.width)
