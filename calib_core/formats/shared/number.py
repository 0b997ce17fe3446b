"""One number as text."""

import math
import re

NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_NUMBER = re.compile(NUMBER)


def number(text: str) -> float:
    """Return a plain finite number; raises ValueError with a phrase for anything else."""
    stripped = text.strip()
    if not _NUMBER.fullmatch(stripped):
        raise ValueError(f"'{stripped[:40]}' is no number")
    value = float(stripped)
    if not math.isfinite(value):
        raise ValueError(f"'{stripped[:40]}' is out of range")
    return value
