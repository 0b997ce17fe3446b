"""Pasted text to poses: one a line, as a spreadsheet, a log or a robot's program has them."""

import re
from dataclasses import dataclass

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.poses.convention import Convention
from calib_core.poses.numbers import convention_named, parse_pose

_POINT = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_COMMA = r"[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?"
# Digits inside names, days and indices (p10, scan-4, 2024-05-01_p, P[3]) are no numbers of a pose.
_NUMBER = re.compile(rf"(?<![\w.])(?<!\w[-+])(?:{_POINT}|[-+]?nan)(?![\w])", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(rf"(?<![\w.,])(?<!\w[-+]){_COMMA}(?![\w])")
_INDEX = re.compile(r"\w+\s*\[\s*\d+\s*(?:,\s*\d+\s*)?\]")
_ROW_NUMBER = re.compile(r"^[ \t]*\d+\s*[:)]\s*")
_GROUP = re.compile(r"[\[({]([^\[\](){}]*)[\])}]")


@dataclass(frozen=True, eq=False)
class PoseLine:
    """One pose found in a text, or why there is none.

    Parameters
    ----------
    line : int
        Where it begins, counted from 1.
    text : str
        As it was pasted.
    numbers : list of float or None
        The convention's numbers.
    pose : RigidTransform or None
        base_from_tool0.
    problem : str or None
        What is wrong and what to do, where there is no pose.
    """

    line: int
    text: str
    numbers: list[float] | None = None
    pose: RigidTransform | None = None
    problem: str | None = None


def parse_pose_lines(convention: str, text: str) -> list[PoseLine]:
    """Return a row for every pose in pasted text.

    Numbers may be separated by blanks, tabs, commas or semicolons; decimal commas are recognised where they give
    the right count; names, brackets and units beside the numbers are passed over.  Blank lines, lines without
    numbers, and lines that begin with # are left out.  A block in braces counts as one line, and so do four rows
    of a matrix.

    Parameters
    ----------
    convention : str
        A name in `CONVENTIONS`.
    text : str

    Raises
    ------
    InputError
        If the convention is unknown.  A line that cannot be read is a row with its `problem` instead.
    """
    known = convention_named(convention)
    return [_row(known, line, part) for line, part in _parts(known, text)]


def _parts(known: Convention, text: str) -> list[tuple[int, str]]:
    """Return (line number, text) of every part of the text that should hold one pose."""
    parts: list[tuple[int, str]] = []
    open_since, block = 0, ""
    for number, line in enumerate(text.splitlines(), start=1):
        if not block and (not line.strip() or line.lstrip().startswith("#")):
            continue
        block = f"{block}\n{line}" if block else line
        open_since = open_since or number
        if block.count("{") <= block.count("}"):
            if _NUMBER.search(_INDEX.sub(" ", block)):
                parts.append((open_since, block))
            open_since, block = 0, ""
    if block:
        parts.append((open_since, block))
    return _joined_matrices(parts) if known.form == "matrix" else parts


def _joined_matrices(parts: list[tuple[int, str]]) -> list[tuple[int, str]]:
    joined: list[tuple[int, str]] = []
    i = 0
    while i < len(parts):
        four = parts[i : i + 4]
        if len(four) == 4 and all(len(_plain_numbers(text, 4) or []) == 4 for _, text in four):
            joined.append((four[0][0], "\n".join(text for _, text in four)))
            i += 4
        else:
            joined.append(parts[i])
            i += 1
    return joined


def _row(known: Convention, line: int, text: str) -> PoseLine:
    numbers = _numbers(known, text)
    try:
        return PoseLine(line, text, numbers, parse_pose(known.name, numbers))
    except InputError as error:
        return PoseLine(line, text, numbers or None, None, str(error))


def _numbers(known: Convention, text: str) -> list[float]:
    """Return the numbers of one pose; of another count where the text does not hold one."""
    labelled = _labelled(known, text)
    if labelled:
        return labelled
    bare = _ROW_NUMBER.sub("", _INDEX.sub(" ", text))
    plain = _plain_numbers(bare, known.count)
    if len(plain) == known.count:
        return plain
    groups = [_plain_numbers(g, known.count) for g in _GROUP.findall(bare)]
    for group in groups:
        if len(group) == known.count:
            return group
    if known.form == "quaternion" and len(groups) >= 2 and [len(g) for g in groups[:2]] == [3, 4]:
        return groups[0] + groups[1]  # a robtarget: trans, rot, then configuration and external axes
    return plain


def _labelled(known: Convention, text: str) -> list[float] | None:
    """Return the numbers that stand after the convention's own names, as in ``X = 1807.5 mm``, if all do."""
    if known.form == "matrix":
        return None
    values: list[float] = []
    number = _POINT if "." in text else _COMMA
    for name in known.numbers.split():
        found = re.findall(rf"(?<![\w]){name}\s*[=:]?\s*({number})(?!,?\d)", text, re.IGNORECASE)
        if len(found) != 1:
            return None
        values.append(float(found[0].replace(",", ".")))
    return values


def _plain_numbers(text: str, count: int) -> list[float]:
    numbers = [float(v) for v in _NUMBER.findall(text)]
    if len(numbers) != count and "." not in text and "," in text:
        with_commas = [float(v.replace(",", ".")) for v in _DECIMAL_COMMA.findall(text)]
        if len(with_commas) == count:
            return with_commas
    return numbers
