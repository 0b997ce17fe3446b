"""What a field of a record needs, in words: pydantic names its own types and patterns."""

from typing import Any, Final

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


def field_error(detail: Any) -> tuple[str, str]:
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
