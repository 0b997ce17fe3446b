"""What a user may say about a file of poses that does not say it itself."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

from calib_core.errors import InputError
from calib_core.messages import message

_UNITS = ("mm", "m")
_LONGEST = 1000


@dataclass(frozen=True)
class Told:
    """What is said about a file of poses; all may be left out.

    Parameters
    ----------
    convention : str, optional
        What the numbers of a pose mean.
    unit : "mm" or "m", optional
        Of the position.
    columns : tuple of str
        What each column of a table is, in their order: a number of the convention (`x`, `A`, `qw` …), `name`,
        `tool`, `frame`, `table` (the turntable's angle), `j1` … `j7` (joints), `-` for one to be left aside.
    base, flange : str, optional
        The two frames of a recording that has several.
    topic : str, optional
        The one of a recording that is to be read.
    arm : str, optional
        The robot's arm by its name, as in `cell.robot.arm`: joints beside the poses are asked whose these are.
    """

    convention: str | None = None
    unit: str | None = None
    columns: tuple[str, ...] = ()
    base: str | None = None
    flange: str | None = None
    topic: str | None = None
    arm: str | None = None

    @classmethod
    def of(cls, words: Mapping[str, str]) -> "Told":
        """Return it from words, the columns with commas or blanks between; raises InputError."""
        names = [field.name for field in fields(cls)]
        for name, word in words.items():
            if name not in names:
                raise InputError.unknown(name, names, "told", message("Say it as NAME=VALUE."))
            if len(word) > _LONGEST:
                need = "at most {longest} characters"
                raise InputError(need, f"{len(word)}", "Shorten it.", f"told: {name}", longest=_LONGEST)
        if words.get("unit", "mm") not in _UNITS:
            raise InputError("mm or m", f"'{words['unit']}'", "Name one of these.", "told: unit")
        plain = {name: word for name, word in words.items() if word and name != "columns"}
        return cls(**plain, columns=tuple(words.get("columns", "").replace(",", " ").split()))


NOTHING_TOLD = Told()
