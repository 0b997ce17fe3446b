"""From JSON data to records."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from calib_core.records.base import Record
from calib_core.records.field_errors import input_error
from calib_core.records.session import Capture, Cell, Session
from calib_core.records.strict_fields import require_known_fields


def parse_session(data: Mapping[str, Any], where: str = "session.json") -> Session:
    """Return the session that JSON data describes.

    Raises
    ------
    InputError
        With the field that is at fault and what it should hold.
    """
    return parsed_record(Session, data, where)


def parse_capture(data: Mapping[str, Any], where: str = "capture") -> Capture:
    """Return the capture that JSON data describes; raises InputError."""
    return parsed_record(Capture, data, where)


def parse_cell(data: Mapping[str, Any], where: str = "cell") -> Cell:
    """Return the cell that JSON data describes; raises InputError."""
    return parsed_record(Cell, data, where)


_R = TypeVar("_R", bound=Record)


def parsed_record(model: type[_R], data: Mapping[str, Any], where: str) -> _R:
    """Return any record that JSON data describes; raises InputError."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, where) from None


def written_record(model: type[_R], data: Mapping[str, Any], where: str, beside: type[Record]) -> _R:
    """Return a record that a person wrote, in which an unknown name is a typing error; raises InputError.

    Fields of the record `beside`, which is read from the same file, are none.
    """
    record = parsed_record(model, data, where)
    require_known_fields(record, where, beside.model_fields)
    return record
