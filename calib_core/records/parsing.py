"""From JSON data to records."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from calib_core.records.base import Record
from calib_core.records.field_errors import input_error
from calib_core.records.session import Capture, Cell, Session


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
