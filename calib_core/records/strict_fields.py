"""What programs write must be known by name: a typing error would have no effect, and nobody would know."""

from collections.abc import Collection, Iterator
from difflib import get_close_matches

from pydantic import BaseModel

from calib_core.errors import InputError
from calib_core.messages import message


def unknown_fields(record: BaseModel, where: str = "") -> Iterator[tuple[str, BaseModel]]:
    """Give the fields of a record, and of those within it, that the format does not know, each with its record."""
    for name in record.model_extra or {}:
        yield f"{where}{name}", record
    for name in record.model_fields_set & set(type(record).model_fields):
        yield from unknown_within(getattr(record, name), f"{where}{name}.")


def require_known_fields(record: BaseModel, where: str, tolerated: Collection[str] = ()) -> None:
    """Refuse a record with a field that the format does not know.

    Parameters
    ----------
    record : BaseModel
    where : str
        What the message says it is.
    tolerated : collection of str
        Unknown fields, dotted, that may be there all the same: they were before.

    Raises
    ------
    InputError
        That names the field and the one that is most likely meant.
    """
    for path, owner in unknown_fields(record):
        if path in tolerated:
            continue
        name = path.rsplit(".", 1)[-1]
        known = [field for field in type(owner).model_fields if field != "format"]
        close = get_close_matches(name, known, 1, 0.6)
        to_do = message("Did you mean '{close}'?", close=close[0]) if close else message("Leave it out.")
        need = message("fields among {known}", known=", ".join(known))
        raise InputError(need, "'{path}', which is unknown", to_do, f"{where}: {path}", path=path)


def unknown_within(value: object, where: str) -> Iterator[tuple[str, BaseModel]]:
    """Give the same of whatever a field holds: a record, or lists and mappings of records."""
    if isinstance(value, BaseModel):
        yield from unknown_fields(value, where)
    elif isinstance(value, list):
        for number, part in enumerate(value):  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
            if not isinstance(part, BaseModel):
                return  # numbers: there may be many
            yield from unknown_fields(part, f"{where}{number}.")
    elif isinstance(value, dict):
        for name, part in value.items():  # pyright: ignore[reportUnknownVariableType]
            yield from unknown_within(part, f"{where}{name}.")
