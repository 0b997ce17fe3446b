"""Pose lines as people paste them: numbers with any separators, labels and brackets around them."""

import re
from typing import Any

from calib_core.errors import CalibrationError

_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")


def parse_numbers(line: str) -> list[float]:
    """Return the numbers in a line; words and labels such as `X=` or `p01` are passed over.

    A comma is a decimal comma where the line has other separators and no decimal point.
    """
    if "." not in line and re.search(r"[;\t]|\d\s+[-+\d]", line) and ", " not in line:
        line = _DECIMAL_COMMA.sub(".", line)
    return [float(text) for text in _NUMBER.findall(line)]


def parse_pose_lines(text: str, convention: str) -> list[dict[str, Any]]:
    """Return each line that is not empty with its numbers and its pose, or what is wrong with it.

    Raises
    ------
    InputError
        If the convention is unknown.
    """
    from calib_core.robot_pose import parse_pose, require_convention

    require_convention(convention)
    items: list[dict[str, Any]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        item: dict[str, Any] = {"line": number, "text": line.strip(), "numbers": parse_numbers(line)}
        try:
            item["matrix"] = parse_pose(convention, item["numbers"], f"line {number}").to_rows()
        except CalibrationError as error:
            item["problem"] = str(error)
        items.append(item)
    return items
