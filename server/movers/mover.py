"""What a mover is: a module of this package with a constant `MOVER`, or an entry point of `scancell.movers`."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from server.sources.source import Settings


class Mover(Protocol):
    """A connection by which a table is turned; `server.live.armed_table` alone uses it, within limits."""

    def go_to(self, table_deg: float) -> None:
        """Begin to turn to an angle; raises OSError, CalibrationError."""
        ...

    def stop(self) -> None:
        """Stop as fast as the machine does; may be called at any time, from any thread; raises OSError."""
        ...

    def close(self) -> None:
        """End the connection; called once."""
        ...


@dataclass(frozen=True)
class MoverEntry:
    """One mover.

    Parameters
    ----------
    name : str
        As REST names it.
    title, does : str
        As a person reads it.
    settings : type
        The record of its settings.
    connect : callable
        Takes an instance of `settings`; raises OSError, CalibrationError, or ImportError where `extra` is missing.
    extra : str, optional
    """

    name: str
    title: str
    does: str
    connect: Callable[[Any], Mover]
    settings: type[Settings] = field(default=Settings)
    extra: str | None = None

    def describe(self) -> dict[str, Any]:
        """Return the entry as JSON data, with the JSON Schema of its settings."""
        told = {"name": self.name, "title": self.title, "does": self.does, "extra": self.extra}
        return {**told, "settings": self.settings.model_json_schema()}
