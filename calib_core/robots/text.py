"""What the readers of controllers' files share: bytes to text, lines, numbers, lists in brackets."""

import codecs
import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate

from calib_core.errors import InputError
from calib_core.formats.shared.number import number
from calib_core.messages import message
from calib_core.robots.phrases import CUT_LINE, require_count

_LARGEST_BYTES = 64_000_000


@dataclass(frozen=True)
class Source:
    """A file's text, with ``\\n`` alone at the ends of lines, and where its lines begin."""

    text: str
    name: str
    starts: tuple[int, ...]

    def line(self, position: int) -> int:
        """Return the line, counted from 1, of a position in the text."""
        return bisect_right(self.starts, position)

    def require_ended(self, line: int) -> None:
        """Raise ValueError for a line that the file ends in: where it is cut, its last number may be too."""
        if line >= len(self.starts) and not self.text.endswith("\n"):
            raise ValueError(CUT_LINE)

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield every line with its number."""
        yield from enumerate(self.text.split("\n"), start=1)


def source_of(data: bytes, name: str) -> Source:
    """Return a file's text: UTF-8, UTF-16 with its mark, or the western code page that controllers write.

    Raises
    ------
    InputError
        If it is no text, or too large to be a controller's file.
    """
    if len(data) > _LARGEST_BYTES:
        need = "a file of at most {limit_mb:g} MB"
        raise InputError(
            need,
            "{size_mb:.0f} MB",
            "Give one file.",
            name,
            limit_mb=_LARGEST_BYTES / 1e6,
            size_mb=len(data) / 1e6,
        )
    text = decoded(data)
    if "\0" in text:
        to_do = message("Give the file as text, as the controller's backup or its editor writes it.")
        raise InputError("a text file", "binary data", to_do, name)
    starts = (0, *accumulate(len(line) + 1 for line in text.split("\n")[:-1]))
    return Source(text, name, starts)


def decoded(data: bytes) -> str:
    """Return bytes as text with ``\\n`` alone at the ends of lines, whatever they are."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def numbers(text: str, count: int | None = None, separator: str = ",") -> tuple[float, ...]:
    """Return numbers between separators; raises ValueError with a phrase where they are not `count` numbers."""
    parts = text.split(separator) if separator.strip() else text.split()
    values = tuple(number(part) for part in parts)
    if count is not None:
        require_count(values, count)
    return values


def without_comments(text: str, begins: str) -> str:
    """Return a text with its comments blanked, from `begins` to the end of the line, positions kept."""
    lines = text.split("\n")
    ends = [unquoted(line, begins) for line in lines]
    return "\n".join(line if at < 0 else line[:at].ljust(len(line)) for line, at in zip(lines, ends, strict=True))


def unquoted(text: str, what: str, begin: int = 0) -> int:
    """Return where something first stands in a text outside of double quotes, from a position on; else −1."""
    pieces = re.compile(f'"[^"]*"?|{re.escape(what)}').finditer(text, begin)
    return next((piece.start() for piece in pieces if piece[0] == what), -1)


def split_top(text: str) -> list[tuple[int, str]]:
    """Return the parts between commas that stand in no bracket and no string, with their positions."""
    parts: list[tuple[int, str]] = []
    depth, begin, quoted = 0, 0, False
    for i, c in enumerate(text):
        if c == '"':
            quoted = not quoted
        elif quoted:
            continue
        elif c in "[({":
            depth += 1
        elif c in "])}":
            depth -= 1
        elif c == "," and depth == 0:
            parts.append((begin, text[begin:i]))
            begin = i + 1
    parts.append((begin, text[begin:]))
    return parts


def closing(text: str, position: int, stops: str = "") -> int:
    """Return the position after the bracket that closes the one at `position`; −1 where none does."""
    pairs = {"[": "]", "(": ")", "{": "}"}
    open_ones: list[str] = []
    quoted = False
    for i in range(position, len(text)):
        c = text[i]
        if c == '"':
            quoted = not quoted
        elif quoted:
            if c == "\n":
                return -1
        elif c in pairs:
            open_ones.append(pairs[c])
        elif c in "])}":
            if not open_ones or c != open_ones.pop():
                return -1
            if not open_ones:
                return i + 1
        elif c in stops:
            return -1
    return -1
