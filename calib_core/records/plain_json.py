"""JSON data from outside that can be stored, compared and sent on anywhere."""

import math
import sys
from typing import Any, cast

from calib_core.errors import InputError
from calib_core.messages import message

MAX_DEPTH = 32
_LARGEST_INTEGER = 2**63


def require_plain(data: Any, where: str) -> None:
    """Refuse what is nested deeper than `MAX_DEPTH`, NaN, infinities, too small and huge numbers, no Unicode.

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


def told_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON text; raises InputError where a name stands in it twice: one would be lost."""
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        twice = next(name for name, _ in pairs if name in seen or seen.add(name))
        raise InputError("names that differ", "'{name}' twice", "Rename or remove one.", name=twice[:80])
    return found


def too_deep(where: str) -> InputError:
    """Return the error for data that is nested too deeply."""
    to_do = "Flatten the data."
    return InputError("at most {max_depth} levels of nesting", "more", to_do, where, max_depth=MAX_DEPTH)


def _require_plain_scalar(value: Any, where: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        got = message("NaN or infinity, or a number beyond 1.8e308")
        raise InputError("finite numbers", got, "Correct it.", where)
    if isinstance(value, float) and 0 < abs(value) < sys.float_info.min:
        got = message("one that is no zero and smaller than computers count, {value:g}", value=value)
        raise InputError("ordinary numbers", got, "Correct it.", where)
    if isinstance(value, int) and abs(value) >= _LARGEST_INTEGER:
        need = "integers of at most 63 bits"
        raise InputError(need, "one of {value} bits", "Correct it.", where, value=value.bit_length())
    if isinstance(value, str):
        if "\0" in value:
            raise InputError("text without NUL characters", "one with", "Leave it out.", where)
        try:
            value.encode()
        except UnicodeEncodeError:
            raise InputError("Unicode text", "half of a surrogate pair", "Correct it.", where) from None
