"""JSON data from outside that can be stored, compared and sent on anywhere."""

import math
from typing import Any, cast

from calib_core.errors import InputError

MAX_DEPTH = 32
_LARGEST_INTEGER = 2**63


def require_plain(data: Any, where: str) -> None:
    """Refuse data nested deeper than `MAX_DEPTH`, NaN, infinities, huge integers, and text that is not Unicode.

    Raises
    ------
    InputError
    """
    level: list[Any] = [data]
    for _ in range(MAX_DEPTH):
        below: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                record = cast("dict[Any, Any]", value)
                below += record.keys()
                below += record.values()
            elif isinstance(value, list):
                below += cast("list[Any]", value)
            else:
                _require_plain_scalar(value, where)
        level = below
        if not level:
            return
    raise too_deep(where)


def too_deep(where: str) -> InputError:
    """Return the error for data that is nested too deeply."""
    return InputError(f"at most {MAX_DEPTH} levels of nesting", "more", "Flatten the data.", where)


def _require_plain_scalar(value: Any, where: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        got = "NaN or infinity, or a number beyond 1.8e308"
        raise InputError("finite numbers", got, "Correct the number.", where)
    if isinstance(value, int) and abs(value) >= _LARGEST_INTEGER:
        raise InputError("integers of at most 63 bits", f"one of {value.bit_length()} bits", "Correct it.", where)
    if isinstance(value, str):
        if "\0" in value:
            raise InputError("text without NUL characters", "one with", "Remove it.", where)
        try:
            value.encode()
        except UnicodeEncodeError:
            raise InputError("Unicode text", "half of a surrogate pair", "Correct the text.", where) from None
