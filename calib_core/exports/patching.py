"""One entry of a controller's backup changed, every other byte as it was."""

import re
from collections.abc import Callable, Iterable
from typing import Any, Literal

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Patch
from calib_core.exports.writing import frames_written, mark
from calib_core.messages import message


def as_bytes_kept(backup: bytes) -> tuple[str, str]:
    """Return a backup's text and the encoding that turns it back into the very same bytes."""
    for mark_of, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if backup.startswith(mark_of) and len(backup) % 2 == 0:
            return backup.decode(encoding, errors="surrogatepass"), encoding
    return backup.decode("latin-1"), "latin-1"


def put_back(text: str, encoding: str) -> bytes:
    """Return the bytes of a text that `as_bytes_kept` gave."""
    return text.encode(encoding, errors="surrogatepass" if encoding != "latin-1" else "strict")


def only_match(pattern: str, text: str, what: str, flags: int = re.MULTILINE | re.IGNORECASE) -> re.Match[str]:
    """Return the one match of an entry in a backup.

    Raises
    ------
    InputError
        If the entry is not there, or more than once.
    """
    found = list(re.finditer(pattern, text, flags))
    if len(found) != 1:
        got = message("{count} of them", count=len(found)) if found else message("none")
        to_do = message("Give the file that defines it, or name another with --tool or --frame.")
        raise InputError("one {what} in the backup", got, to_do, "into", what=what)
    return found[0]


def replaced(text: str, begin: int, end: int, new: str) -> str:
    """Return a text with one stretch of it replaced."""
    return text[:begin] + new + text[end:]


def patched_line(backup: bytes, answer: Answer, comment: str, entries: Iterable[tuple[str, str, str]]) -> bytes:
    """Return a program with the numbers of some entries changed; every other line stays byte for byte.

    Parameters
    ----------
    backup : bytes
    answer : Answer
        For the short note at the line's end (lines are limited there); it takes the place of an earlier one.
    comment : str
        What a comment begins with.
    entries : iterable of tuple
        (what the entry is called, a pattern of its line up to and with the bracket, its six numbers); what stands
        behind six numbers in the bracket stays.

    Raises
    ------
    InputError
        If an entry is not there, or more than once.
    """
    text, encoding = as_bytes_kept(backup)
    number = r"[ \t]*[-+.\deE]+[ \t]*"
    note = f"{comment}{mark(answer)} {answer.date[:10] or 'without date'}, {answer.position_sigma_mm:.3f} mm"
    for what, before, numbers in entries:
        found = only_match(rf"{before}({number}(?:,{number}){{5}})(?=[,)])([^\r\n]*)", text, what)
        kept = re.sub(rf"[ \t]*{re.escape(comment)}(?:DO-NOT-USE|SCANCELL) .*", "", found[2]).rstrip()
        text = replaced(text, found.start(1), found.end(2), f"{numbers}{kept} {note}")
    return put_back(text, encoding)


def patched_by(
    convention: str, put: Callable[[str, Literal["tool", "frame"], list[float], Any, Answer], str]
) -> Patch:
    """Return what changes the tool of a backup, its user frame or both, and leaves every other byte as it is.

    Parameters
    ----------
    convention : str
        Of the brand's numbers.
    put : callable
        (text, which of the two, its numbers, settings, answer) to the text with that entry changed.
    """

    def patch(backup: bytes, answer: Answer, settings: Any) -> bytes:
        text, encoding = as_bytes_kept(backup)
        for one in frames_written(answer, settings, convention, "tool"):
            text = put(text, one.kind, one.pose, one.settings, answer)
        return put_back(text, encoding)

    return patch
