"""The one error type: what was needed, what was there instead, and what to do about it.

The command line prints it, REST sends it as problem details and the page shows it, all from the same fields.
"""

from collections.abc import Mapping
from typing import Self


class CalibrationError(Exception):
    """Something a person can mend.

    Parameters
    ----------
    need : str
        What the program needed, as a phrase: "a pose of 6 numbers (x y z W P R)".
    got : str
        What it found instead: "5 numbers".
    to_do : str
        What the person should do now, as a sentence in the imperative.
    where : str, optional
        The file, capture or field that is at fault.
    """

    code = "calibration"
    status = 422

    def __init__(self, need: str, got: str, to_do: str, where: str = "") -> None:
        super().__init__(need, got, to_do, where)
        self.need = need
        self.got = got
        self.to_do = to_do
        self.where = where

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        return f"{place}need {self.need}, got {self.got}. {self.to_do}"

    @property
    def reason(self) -> str:
        """All of it but where."""
        return f"need {self.need}, got {self.got}. {self.to_do}"

    def at(self, where: str) -> "CalibrationError":
        """Return the same error, told to be at `where` (kept if a finer place is known already)."""
        place = f"{where}: {self.where}" if self.where else where
        if self.where == where or self.where.startswith(f"{where}: "):
            place = self.where
        return type(self)(self.need, self.got, self.to_do, place)

    def with_failures(self, failed: Mapping[str, "CalibrationError"]) -> Self:
        """Return the same error with what was got of captures that failed, by their names."""
        names = "; ".join(f"{name}: {why.got}" for name, why in failed.items())
        return type(self)(self.need, f"{self.got} ({names})", self.to_do, self.where) if failed else self

    def adding(self, sentence: str) -> "CalibrationError":
        """Return the same error with a sentence more on what to do."""
        return type(self)(self.need, self.got, f"{self.to_do} {sentence}", self.where)


class InputError(CalibrationError):
    """A file, a record or a number that cannot be used as it is."""

    code = "input"


class MeasurementError(CalibrationError):
    """A capture in which the object to be measured cannot be found or does not fit."""

    code = "measurement"


class MotionError(CalibrationError):
    """Captures whose motions do not determine what is asked."""

    code = "motion"


class NotFoundError(CalibrationError):
    """A session, capture, result or file that is not there."""

    code = "not-found"
    status = 404


class ConflictError(CalibrationError):
    """A request that contradicts what is stored already."""

    code = "conflict"
    status = 409


class TooLargeError(CalibrationError):
    """More bytes, points or pixels than the limit allows."""

    code = "too-large"
    status = 413


class DamagedError(CalibrationError):
    """Something stored that is not what was stored: the disk, or somebody, has altered it."""

    code = "damaged"
    status = 503
