"""An export: the answer of a calibration in another program's syntax."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel, ConfigDict

from calib_core.exports.answer import Answer
from calib_core.proof import Proof, is_experimental


class Settings(BaseModel):
    """What may be chosen for an export; each has its own subclass, whose JSON Schema is shown."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Write = Callable[[Answer, Any], str | bytes]
Patch = Callable[[bytes, Answer, Any], bytes]


@dataclass(frozen=True)
class Export:
    """One export, in a module of its own with a constant `EXPORT`, or among a brand's.

    Parameters
    ----------
    name : str
        As `--format` and the REST path name it.
    title : str
        As a person reads it.
    media_type, suffix : str
        Of the file; the suffix with its dot.
    write : callable
        (answer, settings) to the file's text or bytes; raises ConflictError where the answer lacks what it needs.
    settings : type
        The record of its settings.
    brand : str
        The robot brand that it belongs to, or empty.
    patch : callable, optional
        (backup, answer, settings) to the backup with one entry changed and every other byte as it was.
    suits : callable, optional
        Takes a backup's files; raises InputError where one of them says that it cannot take the entry.
    comment : str
        What begins a line that the other program does not read: an answer with faults is marked in one.
    proof : Proof, optional
        What proved that the other program takes it; None for the project's own forms.
    open_too : bool
        Whether it can say that a position is not determined, or writes a table in its scanner's frame.
    """

    name: str
    title: str
    media_type: str
    suffix: str
    write: Write
    settings: type[Settings] = field(default=Settings)
    brand: str = ""
    patch: Patch | None = None
    comment: str = "#"
    proof: Proof | None = "manual only"
    open_too: bool = False
    suits: Callable[[Mapping[str, bytes]], None] | None = None

    def describe(self) -> dict[str, Any]:
        """Return the entry as JSON data, with the JSON Schema of its settings."""
        return {
            "name": self.name,
            "title": self.title,
            "media_type": self.media_type,
            "suffix": self.suffix,
            "brand": self.brand or None,
            "patches_a_backup": self.patch is not None,
            "proof": self.proof,
            "experimental": is_experimental(self.proof),
            "settings": self.settings.model_json_schema(),
        }
