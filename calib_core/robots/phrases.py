"""What the readers of all brands say alike of what they do not take."""

from collections.abc import Sized

CALCULATED = "a calculated position has no value in the file"
CUT = "is the file cut?"
CUT_LINE = f"the file ends in this line, without an end of line: {CUT}"
TWICE = "it stands there twice"
UNMATCHED = f"its brackets do not match: {CUT}"


def changed(line: int) -> str:
    """Return the doubt about a value that the program changes in a line."""
    return f"The program changes it (line {line}): the value here may be another."


def require_count(values: Sized, least: int, most: int | None = None) -> None:
    """Raise ValueError with a phrase unless there are `least` values, or from `least` to `most`."""
    if not least <= len(values) <= (least if most is None else most):
        raise ValueError(f"{len(values)} numbers instead of {least}")
