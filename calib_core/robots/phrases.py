"""What the readers of all brands say alike of what they do not take."""

from collections.abc import Sized

from calib_core.messages import Message, message, plural

CALCULATED = message("a calculated position has no value in the file")
CUT = message("is the file cut?")
CUT_LINE = message("the file ends in this line, without an end of line: {cut}", cut=CUT)
TWICE = message("it stands there twice")
UNMATCHED = message("its brackets do not match: {cut}", cut=CUT)


def of_line(is_tool: bool, line: int) -> Message:
    """Return the name of a tool, or of a frame, that has none in the file."""
    return message("tool of line {line}", line=line) if is_tool else message("frame of line {line}", line=line)


def changed(line: int) -> str:
    """Return the doubt about a value that the program changes in a line."""
    return message("The program changes it (line {line}): the value here may be another.", line=line)


def shifted(line: int) -> str:
    """Return the doubt about a position to which a move in a line adds something."""
    return message(
        "A move adds an offset to it (line {shifted}): make sure that the robot stood here.", shifted=line
    )


def require_count(values: Sized, least: int, most: int | None = None) -> None:
    """Raise ValueError with a phrase unless there are `least` values, or from `least` to `most`."""
    if not least <= len(values) <= (least if most is None else most):
        raise ValueError(
            plural(
                "{count} number instead of {least}",
                "{count} numbers instead of {least}",
                by="count",
                count=len(values),
                least=least,
            )
        )
