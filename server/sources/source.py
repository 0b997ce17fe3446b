"""What a source is: a module of this package, or an entry point of the group ``scancell.sources``.

It takes captures when it is asked to (`trigger`), or it is a live device (`connect`), or captures come from it by
themselves.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from calib_core.records import Capture, Session, input_error
from server.sources.device import Clock, Device, Role

Taken = tuple[Capture, Mapping[str, bytes]]
"""A capture and its files by name."""


class Settings(BaseModel):
    """What may be chosen for a source; each has its own subclass, whose JSON Schema is shown."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def parsed(cls, settings: dict[str, Any]) -> Self:
        """Return settings as they came, checked; raises InputError."""
        try:
            return cls.model_validate(settings)
        except ValidationError as error:
            raise input_error(error, settings, "settings") from None


@dataclass(frozen=True)
class Occasion:
    """When a source is asked for a capture.

    Parameters
    ----------
    session : Session
        Without captures: its cell says the convention of poses.
    taken : collection of str
        The ids of its captures.
    device : mapping
        What the session keeps of its simulated cell: scenario and seed; empty for a real one.
    settings : Settings
        An instance of the source's own.
    """

    session: Session
    taken: Collection[str]
    device: Mapping[str, Any]
    settings: Any


@dataclass(frozen=True)
class Source:
    """One source, in a module of its own with a constant `SOURCE`.

    Parameters
    ----------
    name : str
        As the REST path names it.
    title : str
        As a person reads it.
    does : str
        What it does, a sentence.
    settings : type
        The record of its settings.
    trigger : callable, optional
        Takes one capture now; raises CalibrationError.  Left out where captures come by themselves.
    connect : callable, optional
        Takes an instance of `settings` and returns the connected device; raises OSError, CalibrationError, or
        ImportError where `extra` is not installed.
    delivers : tuple of str
        What the device tells of: "robot", "table", "scanner".
    extra : str, optional
        The extra of this package that must be installed: `pip install scancell[opcua]`.
    clock : "every-reading", "on-change" or "none"
        What the device time of its readings means; by it a stream that repeats one reading is told.
    is_asked : bool
        `read` looks anew each time: that there is nothing new is a sign of life as well, except in a stream.
    """

    name: str
    title: str
    does: str
    settings: type[Settings] = field(default=Settings)
    trigger: Callable[[Occasion], Taken] | None = None
    connect: Callable[[Any], Device] | None = None
    delivers: tuple[Role, ...] = ()
    extra: str | None = None
    clock: Clock = "none"
    is_asked: bool = False

    def describe(self) -> dict[str, Any]:
        """Return the entry as JSON data, with the JSON Schema of its settings."""
        return {
            "name": self.name,
            "title": self.title,
            "does": self.does,
            "triggered": self.trigger is not None,
            "delivers": list(self.delivers),
            "extra": self.extra,
            "clock": self.clock,
            "settings": self.settings.model_json_schema(),
        }
