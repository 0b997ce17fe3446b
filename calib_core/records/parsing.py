"""From JSON data to records, and from pydantic's errors to need, got and what to do."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from calib_core.errors import InputError
from calib_core.records.base import PoseConvention, Record
from calib_core.records.field_errors import field_error
from calib_core.records.session import Capture, Cell, Session


def parse_session(data: Mapping[str, Any], where: str = "session.json") -> Session:
    """Return the session that JSON data describes.

    Raises
    ------
    InputError
        With the field that is at fault and what it should hold.
    """
    return _parse(Session, data, where)


def parse_capture(data: Mapping[str, Any], where: str = "capture") -> Capture:
    """Return the capture that JSON data describes; raises InputError."""
    return _parse(Capture, data, where)


def parse_cell(data: Mapping[str, Any], where: str = "cell") -> Cell:
    """Return the cell that JSON data describes; raises InputError."""
    return _parse(Cell, data, where)


_R = TypeVar("_R", bound=Record)


def parsed_record(model: type[_R], data: Mapping[str, Any], where: str) -> _R:
    """Return any record that JSON data describes; raises InputError."""
    return _parse(model, data, where)


def _parse(model: type[_R], data: Mapping[str, Any], where: str) -> _R:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, where) from None


def input_error(error: ValidationError, data: Any, where: str) -> InputError:
    """Return a validation error as need, got and what to do, naming the capture it stands in."""
    return input_error_from_details(error.errors(include_url=False), data, where)


def input_error_from_details(details: Sequence[Any], data: Any, where: str) -> InputError:
    """Return the first of pydantic's error details as need, got and to_do (a request's `body` is left out)."""
    first = details[0]
    place = _place(first["loc"][1:] if first["loc"][:1] == ("body",) else first["loc"], data)
    message, got = field_error(first)
    to_do = "Correct this field."
    if first["type"] == "missing":
        got, message = "nothing", f"the field '{first['loc'][-1]}'"
        to_do = "Add it."
    elif first["loc"] and first["loc"][-1] == "pose_convention":
        message = "one of the pose conventions " + ", ".join(get_args(PoseConvention))
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
