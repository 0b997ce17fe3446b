"""The unit of positions that a file does not state: told, or left only one choice by an arm's reach."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.poses.conventions import CONVENTIONS

_NEAREST_MM, _FARTHEST_MM = 20.0, 8000.0
_MM = {"mm": 1.0, "m": 1000.0}
UNITS = {**_MM, "cm": 10.0, "um": 0.001, "µm": 0.001, **dict.fromkeys(("in", "inch", "inches"), 25.4)}
"""The mm of each unit that a header may state."""


class Scale(NamedTuple):
    """What positions are multiplied by to be in the convention's unit, and what is open about that."""

    factor: float
    doubt: str


def scale_of(convention: str, unit: str, places: Sequence[Sequence[float]], where: str) -> Scale:
    """Return the factor to the convention's unit.

    A convention whose unit its makers fix (a controller's) is believed.  Elsewhere the unit is told, or only one
    of millimetres and metres puts every flange within an arm's reach: then that one, with a doubt.

    Raises
    ------
    InputError
        If neither says it.
    """
    known = CONVENTIONS[convention]
    if unit in UNITS:
        return Scale(UNITS[unit] / known.mm_per_unit, "")
    if known.brands != "any" or not places:
        return Scale(1.0, "")
    lengths = [math.dist(place, (0.0, 0.0, 0.0)) for place in places]
    fits = [
        name for name, mm in _MM.items() if all(_NEAREST_MM <= length * mm <= _FARTHEST_MM for length in lengths)
    ]
    if len(fits) != 1:
        to_do = message("Say unit=mm or unit=m.")
        raise InputError("the unit of the positions", "none", to_do, where)
    doubt = message(
        "The file states no unit: {fits} is taken, since the flange would be out of an arm's reach otherwise.",
        fits=fits[0],
    )
    return Scale(_MM[fits[0]] / known.mm_per_unit, doubt)
