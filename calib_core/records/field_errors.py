"""From pydantic's errors to need, got and what to do: pydantic names its own types and patterns."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from pydantic import ValidationError

from calib_core.errors import InputError
from calib_core.messages import filled, message, plural, templates
from calib_core.poses.conventions import CONVENTIONS

_WORDS: Final = templates(
    {
        r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$": "up to 64 letters, digits, '.', '_' or '-', no sign first",
        r"^[A-Za-z0-9._-]{1,40}$": "up to 40 letters, digits, '.', '_' or '-'",
        r"^[A-Za-z0-9_ -]{1,80}$": "up to 80 letters, digits, blanks, '_' or '-'",
        r"^[A-Za-z0-9]{8,64}$": "8 to 64 letters or digits",
        r"^\w{1,32}$": "up to 32 letters, digits or '_'",
        r"^[A-Za-z_]\w{0,31}(\[\d{1,4}\])?$": "a name of letters, digits and '_', such as tScanner or tTool[1]",
        r"^[A-Za-z_][\w.]{0,31}(\[\d{1,4}\])?$": "a name of letters, digits, '_' and '.', such as grip.1",
        r"^[A-Za-z0-9.:-]{1,64}$": "a host's name or address",
        r"^https?://\S+$": "an address that begins with http:// or https://",
        r"^wss?://\S+$": "an address that begins with ws:// or wss://",
        r"^opc\.tcp://\S+$": "an address that begins with opc.tcp://",
        r"^\.[A-Za-z0-9]{1,8}$": "an ending such as .csv",
        r"^E[1-6]$": "an external axis, E1 to E6",
        r"^\d{1,15}$": "a number of up to 15 digits",
        r"^[0-9a-f]{64}$": "64 hexadecimal digits",
        r"^\d{4}-[01]\d-[0-3]\dT[0-2]\d:[0-5]\d:[0-5]\d\.\d{3}Z$": "a moment such as 2026-01-31T12:00:00.000Z",
    }
)
OTHER: Final = message("a text of another form")
"""For a pattern that another package brings."""

SMALLEST: Final = 1e-20
"""What is positive is not less: its square is still a number."""

_NEEDED: Final = templates(
    {
        "model_type": "an object in braces",
        "model_attributes_type": "an object in braces",
        "dict_type": "an object in braces",
        "list_type": "a list in brackets",
        "tuple_type": "a list in brackets",
        "string_type": "a text",
        "float_type": "a number",
        "float_parsing": "a number",
        "int_type": "a whole number",
        "int_parsing": "a whole number",
        "int_from_float": "a whole number",
        "bool_type": "true or false",
        "bool_parsing": "true or false",
        "finite_number": "a finite number",
        "greater_than": "more than {gt:g}",
        "greater_than_equal": "at least {ge:g}",
        "less_than": "less than {lt:g}",
        "less_than_equal": "at most {le:g}",
        "too_short": "a list of at least {min_length}",
        "too_long": "a list of at most {max_length}",
        "string_too_short": "a text of at least {min_length} characters",
        "string_too_long": "a text of at most {max_length} characters",
    }
)


def input_error(error: ValidationError, data: Any, where: str) -> InputError:
    """Return a validation error as need, got and what to do, naming the capture it stands in."""
    return input_error_from_details(error.errors(include_url=False), data, where)


def input_error_from_details(details: Sequence[Any], data: Any, where: str) -> InputError:
    """Return the first of pydantic's error details as need, got and to_do (a request's `body` is left out)."""
    first = details[0]
    place = _place(first["loc"][1:] if first["loc"][:1] == ("body",) else first["loc"], data)
    need, got = _field_error(first)
    to_do = message("Correct it.")
    if first["type"] == "missing":
        got, need = message("nothing"), message("the field '{first}'", first=first["loc"][-1])
        to_do = message("Add it.")
    elif first["loc"] and first["loc"][-1] == "pose_convention":
        need = message("one of the pose conventions {conventions}", conventions=", ".join(CONVENTIONS))
        to_do = message("Name the controller's convention.")
    elif first["type"] == "value_error" and len(parts := first["ctx"]["error"].args) == 4:
        _, need, got, to_do = parts  # of a `mismatch`
    more = len(details) - 1
    if more:
        to_do = plural(
            "{to_do} ({count} more field will need attention.)",
            "{to_do} ({count} more fields will need attention.)",
            by="count",
            to_do=to_do,
            count=more,
        )
    return InputError(need, got, to_do, f"{where}: {place}" if place else where)


def _place(location: tuple[int | str, ...], data: Any) -> str:
    """Return a path like `captures[p05].pose`, captures by their id."""
    text = ""
    for key in location:
        name: object = key
        try:
            data = data[key]
            if isinstance(key, int) and isinstance(data, Mapping) and "id" in data:
                name = data["id"]
        except (KeyError, IndexError, TypeError):
            data = None
        text += f"[{name}]" if isinstance(key, int) else f".{key}" if text else str(key)
    return text


def _field_error(detail: Any) -> tuple[str, str]:
    """Return what a field needs and what it got, of one of pydantic's error details."""
    got = _shortened(repr(detail["input"]))
    kind, about = detail["type"], detail.get("ctx", {})
    if kind in ("too_short", "too_long"):
        got = f"{about['actual_length']}: {got}"
    if about.get("ge") == SMALLEST and detail["input"] <= 0:
        kind, about = "greater_than", {"gt": 0}
    if kind == "string_pattern_mismatch":
        return in_words(str(about["pattern"])), got
    said = detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return filled(str(_NEEDED.get(kind, said[0].lower() + said[1:])), about), got


def _shortened(text: str) -> str:
    return text if len(text) < 80 else text[:77] + "…"


def in_words(pattern: str) -> str:
    """Return what a text must look like that a pattern describes."""
    return _WORDS.get(pattern, OTHER)
