"""The one error type: what was needed, what was there instead, and what to do about it.

The command line prints it, REST sends it as problem details and the page shows it, all from the same fields.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

from calib_core.messages import ENGLISH, Catalogue, Message, Value, filled, message, sentences


class CalibrationError(Exception):
    """Something a person can mend.

    Its parts are texts, or templates with named places that `values` fill; they are said in other languages too
    (`calib_core.messages`).  A text with braces whose places have no values stays as it is.

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
    **values
        What fills the places.

    Attributes
    ----------
    findings : sequence of calib_core.records.Finding
        What is at fault, as far as it was found out: the likeliest first.
    """

    code = "calibration"
    status = 422
    findings: Sequence[Any] = ()  # records stand above

    def __init__(self, need: str, got: str, to_do: str, where: str = "", **values: Value) -> None:
        self.need, self.got, self.to_do = (filled(text, values) for text in (need, got, to_do))
        self.where = where
        super().__init__(self.need, self.got, self.to_do, where)

    @classmethod
    def unknown(cls, name: str, known: Iterable[str], where: str, to_do: str = "") -> Self:
        """Return that a name is none of those that are known, at the field or argument that has it."""
        need = message("one of {names}", names=", ".join(known))
        return cls(need, f"'{name[:80]}'", to_do or message("Name one of these."), where)

    def __str__(self) -> str:
        return self.said()

    def said(self, language: Catalogue = ENGLISH) -> str:
        """Return all of it in a language."""
        return language.say(self.message)

    @property
    def message(self) -> Message:
        """All of it."""
        return message("{what}: {why}", what=self.where, why=self.reason) if self.where else self.reason

    @property
    def reason(self) -> Message:
        """All of it but where."""
        return message("need {need}, got {got}. {to_do}", need=self.need, got=self.got, to_do=self.to_do)

    @property
    def lack(self) -> Message:
        """What is amiss, as a sentence: all of it but where, and what to do."""
        return message("Need {need}, got {got}.", need=self.need, got=self.got)

    def at(self, where: str) -> Self:
        """Return the same error, told to be at `where` (kept if a finer place is known already)."""
        place = f"{where}: {self.where}" if self.where else where
        if self.where == where or self.where.startswith(f"{where}: "):
            place = self.where
        return self._with(where=place)

    def explained_by(self, findings: Sequence[Any]) -> Self:
        """Return the same error with what is at fault."""
        found = self._with()
        found.findings = findings
        return found

    def _with(self, *, got: str = "", to_do: str = "", where: str = "") -> Self:
        found = type(self)(self.need, got or self.got, to_do or self.to_do, where or self.where)
        found.findings = self.findings
        return found

    def with_failures(self, failed: Mapping[str, "CalibrationError"]) -> Self:
        """Return the same error with what was got of captures that failed, by their names."""
        if not failed:
            return self
        names = "; ".join(f"{{name{k}}}: {{why{k}}}" for k in range(len(failed)))
        values = {f"name{k}": name for k, name in enumerate(failed)}
        values |= {f"why{k}": why.got for k, why in enumerate(failed.values())}
        return self._with(got=Message(f"{{got}} ({names})", {"got": self.got, **values}))

    def after(self, first: Sequence[str]) -> Self:
        """Return the same error with sentences before those on what to do: what was left out, and why."""
        return self._with(to_do=sentences((*first, self.to_do))) if first else self

    def adding(self, sentence: str) -> Self:
        """Return the same error with a sentence more on what to do."""
        return self._with(to_do=sentences((self.to_do, sentence)))


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
