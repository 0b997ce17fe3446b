"""Text as scanners' programs write it: its encoding, its first lines, how the fields of a line are separated."""

import csv
import re
from dataclasses import dataclass

from calib_core.errors import InputError

_HEAD_LINES = 2000  # where the table must have begun
_HEAD_CHARACTERS = 1_000_000
_SEPARATORS = (";", "\t", ",", "|")
NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*\Z", re.ASCII)
_COMMA_NUMBER = re.compile(r"[+-]?(\d+,?\d*|,\d+|\d{1,3}(\.\d{3})+,\d*)([eE][+-]?\d+)?\Z")
_THOUSANDS = re.compile(r"\s*[+-]?\d{1,3}(\.\d{3})+,\d*\s*\Z")
NAN_WORDS = {"nan", "-nan", "+nan", "inf", "-inf", "+inf", "infinity", "-infinity", "null", "none"}
BLANK_WORDS = {"", "-", "--", "---", "*", "n/a", "#n/a", "na", "invalid", *NAN_WORDS}


@dataclass(frozen=True)
class Style:
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
        return [_with_point(field) for field in found] if self.comma else found


def _with_point(field: str) -> str:
    """Return a field with a point for its decimal comma, and none for thousands: 1.234,5."""
    return (field.replace(".", "") if _THOUSANDS.match(field) else field).replace(",", ".")


def decode_text(data: bytes, where: str, example: str) -> str:
    """Return a text in UTF-8, UTF-16, Windows' Latin or Japanese; raises InputError where it is none."""
    if not data.strip():
        to_do = "Copy or export it again."
        raise InputError("lines of numbers ({example})", "an empty file", to_do, where, example=example)
    text = _decoded(data)
    if text is None:
        need = "lines of numbers as text ({example})"
        raise InputError(need, "bytes that are no text", "Export it as text.", where, example=example)
    text = text if text.isascii() else text.replace("\u2212", "-")  # a minus as it is printed
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def looks_like_text(data: bytes) -> bool:
    """Return whether the first bytes of a file are text."""
    return bool(data.strip()) and _decoded(data[:4000], cut=True) is not None


def _decoded(data: bytes, cut: bool = False) -> str | None:
    ways = ["utf-8-sig", "cp1252", "cp932"]
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        ways = ["utf-16"]
    elif data[1:40:2].count(0) > 15:
        ways = ["utf-16-le"]
    elif data[0:40:2].count(0) > 15:
        ways = ["utf-16-be"]
    for way in ways:
        try:
            text = data.decode(way, errors="ignore" if cut and way.startswith("utf") else "strict")
        except UnicodeDecodeError:
            continue
        ended = text.rstrip("\0\x1a")  # as old programs end a file
        text = ended if "\n" in ended or "\r" in ended else text
        return None if "\0" in text or (way.startswith("cp") and _is_binary(text)) else text
    return None


def _is_binary(text: str) -> bool:
    head = text[:4000]
    return sum(ord(mark) < 32 and mark not in "\t\r\n\f" for mark in head) > 0


def first_lines(text: str, count: int = _HEAD_LINES) -> list[str]:
    """Return the first lines of a text, so many that its table must have begun."""
    lines = text[:_HEAD_CHARACTERS].split("\n")
    if len(text) > _HEAD_CHARACTERS and len(lines) > 1:
        lines.pop()  # it was cut
    return lines[:count]


def number_of(field: str) -> float | None:
    """Return the number that a field is, None where it is none."""
    return float(field) if NUMBER.match(field) else None


def style_of(line: str) -> Style:
    """Return how a line's fields are written."""
    words = line.split()
    quoted = '"' in line
    separator = next((mark for mark in _SEPARATORS if mark in line), None)
    if separator == "," and len(words) > 1 and all(_COMMA_NUMBER.match(word) for word in words):
        return Style(None, True, False)
    comma = separator in (";", "\t") or (quoted and separator == "," and _quotes_decimal_commas(line))
    return Style(separator, comma, quoted)


def _quotes_decimal_commas(line: str) -> bool:
    return re.search(r'"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*"', line) is not None
