"""Session records of earlier formats, brought to the present one step by step."""

from collections.abc import Callable, Mapping
from typing import Any, Final, cast

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.records import FORMAT

Data = dict[str, Any]

_OF_THE_CELL: Final = ("sphere_diameter_mm", "sphere_diameter_sigma_mm", "pose_convention", "scanner", "robot")


def to_present_format(record: Mapping[str, Any], where: str) -> Data:
    """Return a session's record in the present format; one that is in it already stays as it is.

    Parameters
    ----------
    record : mapping
        JSON data as it was read.
    where : str
        What messages call it.

    Raises
    ------
    InputError
        If it names no format, or one that this version does not know.
    """
    present = dict(record)
    if "format" not in present:
        raise InputError("the field 'format'", "nothing", 'Add "format": "{format}".', where, format=FORMAT)
    for _ in _STEPS:  # no record takes more steps than there are
        step = _STEPS.get(str(present["format"]))
        if step is None:
            break
        present = step(present)
    if present["format"] != FORMAT:
        to_do = message("Use a version of scancell that knows it, or correct the field.")
        raise InputError.unknown(str(present["format"]), [*_STEPS, FORMAT], f"{where}: format", to_do)
    return present


def _from_0(record: Data) -> Data:
    """Format 0 had the cell's fields beside the captures, one `file` a capture, and `table_angle_deg`."""
    cell = {**{name: record[name] for name in _OF_THE_CELL if name in record}, **_mapping(record.get("cell"))}
    others = {name: value for name, value in record.items() if name not in _OF_THE_CELL}
    captures = record.get("captures", [])
    if isinstance(captures, list):
        captures = [_capture_from_0(capture) for capture in cast("list[Any]", captures)]
    return {**others, "format": "scancell-session/1", "cell": cell, "captures": captures}


def _capture_from_0(capture: Any) -> Any:
    if not isinstance(capture, dict):
        return capture  # what it should be is said where records are parsed
    present = dict(cast("Data", capture))
    if "file" in present and "files" not in present:
        present["files"] = [present.pop("file")]
    if "table_angle_deg" in present and "table_deg" not in present:
        present["table_deg"] = present.pop("table_angle_deg")
    return present


def _mapping(value: Any) -> Data:
    return cast("Data", value) if isinstance(value, dict) else {}


_STEPS: Final[dict[str, Callable[[Data], Data]]] = {"scancell-session/0": _from_0}
