"""From pydantic's errors to need, got and what to do: pydantic names its own types and patterns."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from pydantic import ValidationError

from calib_core.errors import InputError
from calib_core.poses.conventions import CONVENTIONS

_NEEDED: Final = {
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
}


def input_error(error: ValidationError, data: Any, where: str) -> InputError:
    """Return a validation error as need, got and what to do, naming the capture it stands in."""
    return input_error_from_details(error.errors(include_url=False), data, where)


def input_error_from_details(details: Sequence[Any], data: Any, where: str) -> InputError:
    """Return the first of pydantic's error details as need, got and to_do (a request's `body` is left out)."""
    first = details[0]
    place = _place(first["loc"][1:] if first["loc"][:1] == ("body",) else first["loc"], data)
    message, got = _field_error(first)
    to_do = "Correct this field."
    if first["type"] == "missing":
        got, message = "nothing", f"the field '{first['loc'][-1]}'"
        to_do = "Add it."
    elif first["loc"] and first["loc"][-1] == "pose_convention":
        message = "one of the pose conventions " + ", ".join(CONVENTIONS)
        to_do = "Name the controller's convention."
    elif first["type"] == "value_error" and len(parts := first["ctx"]["error"].args) == 4:
        _, message, got, to_do = parts  # of a `mismatch`
    more = len(details) - 1
    if more:
        to_do += f" ({more} more field{'s' if more > 1 else ''} will need attention.)"
    return InputError(message, got, to_do, f"{where}: {place}" if place else where)


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
    match kind:
        case "greater_than":
            return f"more than {about['gt']:g}", got
        case "greater_than_equal":
            return f"at least {about['ge']:g}", got
        case "less_than":
            return f"less than {about['lt']:g}", got
        case "less_than_equal":
            return f"at most {about['le']:g}", got
        case "too_short":
            return f"a list of at least {about['min_length']}", f"{about['actual_length']}: {got}"
        case "too_long":
            return f"a list of at most {about['max_length']}", f"{about['actual_length']}: {got}"
        case "string_too_short":
            return f"a text of at least {about['min_length']} characters", got
        case "string_too_long":
            return f"a text of at most {about['max_length']} characters", got
        case "string_pattern_mismatch":
            return f"a text of the form {about['pattern']}", got
        case _:
            message = detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
            return str(_NEEDED.get(kind, message[0].lower() + message[1:])), got


def _shortened(text: str) -> str:
    return text if len(text) < 80 else text[:77] + "…"
