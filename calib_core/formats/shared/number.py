"""One number as text."""

import math
import re

from calib_core.messages import message

NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_NUMBER = re.compile(NUMBER)


def number(text: str) -> float:
    """Return a plain finite number; raises ValueError with a phrase for anything else."""
    stripped = text.strip()
    if not _NUMBER.fullmatch(stripped):
        raise ValueError(message("'{stripped}' is no number", stripped=stripped[:40]))
    value = float(stripped)
    if not math.isfinite(value):
        raise ValueError(message("'{stripped}' is out of range", stripped=stripped[:40]))
    return value
