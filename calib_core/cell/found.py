"""Where a result says that scanner and ball are."""

from collections.abc import Mapping
from typing import Any, Final

from calib_core.cell.layout import Carrier
from calib_core.cell.walk import Carriers
from calib_core.errors import InputError
from calib_core.frames import RigidTransform

_MOUNTS: Final[tuple[Carrier, ...]] = ("tool0", "base")


def scanner_frame(result: Mapping[str, Any]) -> RigidTransform:
    """Return the scanner's pose on what carries it, of a result or of what is known, as JSON data.

    Raises
    ------
    InputError
        If it has none.
    """
    for mount in _MOUNTS:
        if (rows := result.get(f"{mount}_from_laser")) is not None:
            return RigidTransform.from_rounded(rows, mount, "laser")
    raise InputError("tool0_from_laser or base_from_laser", "neither", "Solve the stage 'tcp' again.", "tcp")


def carriers_found(result: Mapping[str, Any]) -> Carriers:
    """Return what carries scanner and ball, by a result as JSON data."""
    return Carriers("base", "tool0") if result.get("base_from_laser") is not None else Carriers("tool0", "base")
