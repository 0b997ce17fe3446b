"""Results that users bring with a cell: matrices that are no rigid transforms are refused where they enter."""

from typing import Final, Literal

from calib_core.cell.found import ON_FLANGE
from calib_core.errors import CalibrationError, InputError
from calib_core.frames import RigidTransform
from calib_core.records import Cell

_FRAMES: Final[dict[str, tuple[Literal["tool0", "base"], Literal["laser", "turntable"]]]] = {
    ON_FLANGE: ("tool0", "laser"),
    "base_from_laser": ("base", "laser"),
    "base_from_turntable": ("base", "turntable"),
}


def require_rigid(cell: Cell) -> None:
    """Refuse a cell whose known frames are no rigid transforms; raises InputError."""
    for name, (into, outof) in _FRAMES.items():
        matrix = getattr(cell.known, name)
        if matrix is None:
            continue
        try:
            RigidTransform.from_rounded(matrix, into, outof)
        except CalibrationError as error:
            raise InputError(error.need, error.got, error.to_do, f"cell.known.{name}") from None
