"""A judgement as data: what was noticed, by its code, in which captures, with which values."""

from typing import Any, Literal

from pydantic import Field

from calib_core.records.base import Record
from calib_core.records.causes import RootCause

Severity = Literal["error", "warning", "note"]
"""An error makes a result fail, a warning makes it doubtful, a note only tells."""

Told = int | float | str


class MessageParts(Record):
    """A value that is a message itself, so that it can be said in another language."""

    template: str
    values: dict[str, Any] = Field(default_factory=dict[str, Any])
    many: str = ""
    by: str = ""


class Finding(Record):
    """Something that was noticed.

    `code` names it in the table of codes (`GET findings`, `scancell findings`), which also says how severe it is;
    `values` have their units in their names.  `text` says it and `to_do` what to do, in the language that was
    asked for.  `remedy` is what Apply changes, null where nothing but other captures mends it.

    `where` says where it is if it is not in captures: a field of the session, a file, a device.
    `each` holds, by capture, the values that differ among `captures`; `values` are then those of the first.
    `messages` are the parts of values that are messages themselves, by the value's name; those of `each` by
    capture, a colon and the name.
    `behind` is the code of the finding from which this one only follows.
    """

    code: str
    severity: Severity
    captures: list[str] = Field(default_factory=list[str])
    values: dict[str, Told] = Field(default_factory=dict[str, Told])
    text: str
    to_do: str = ""
    remedy: RootCause | None = None
    where: str = ""
    each: dict[str, dict[str, Told]] = Field(default_factory=dict[str, dict[str, Told]])
    messages: dict[str, MessageParts] = Field(default_factory=dict[str, MessageParts])
    behind: str | None = None
