"""A decision of a verification after which its evidence was changed."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Final

from pydantic import Field

from calib_core.messages import Message, Names, message, sentences, templates
from calib_core.moment import said_moment
from calib_core.records.acting import said_who
from calib_core.records.base import Record
from calib_core.records.policy import Excluded

DECISIONS: Final = templates({
    "pass": "passed",
    "conditional-pass": "conditional pass",
    "conditional-fail": "conditional fail",
    "fail": "failed",
    "undecided": "undecided",
})  # fmt: skip
"""Decisions of a verification, in words."""


class LeftOut(Record):
    """A capture that was left out after a decision, taken in again, added or changed, and why where that was told.

    `deleted` is whether it was taken out of the session for good, `fields` are those that were changed.
    """

    capture: str
    because: Excluded | None = None
    deleted: bool = False
    fields: list[str] = Field(default_factory=list[str])


class DecidedBefore(Record):
    """A decision that was made before captures were left out, added or changed, a limit (by figure) or the cell.

    `taken_back` are those of `added` that had been left out before, `came` the others; `otherwise` is whether its
    inputs are others and nothing says which; `removed` is whether all that is left of it is what a later one's
    seal says; `text` says it all.
    """

    decision: str
    solved: str | None = None
    left_out: list[LeftOut] = Field(default_factory=list[LeftOut])
    added: list[str] = Field(default_factory=list[str])
    limits: list[str] = Field(default_factory=list[str])
    taken_back: list[LeftOut] = Field(default_factory=list[LeftOut])
    came: list[LeftOut] = Field(default_factory=list[LeftOut])
    changed: list[LeftOut] = Field(default_factory=list[LeftOut])
    cell: list[str] = Field(default_factory=list[str])
    otherwise: bool = False
    removed: bool = False
    text: str = ""

    def said(self) -> Message:
        """Return it as sentences."""
        word = DECISIONS.get(self.decision, self.decision)
        if self.solved:
            when = self.solved[:16].replace("T", " ")
            begin = message("The decision of {when} UTC was: {decision}.", when=when, decision=word)
        else:
            begin = message("A decision before was: {decision}.", decision=word)
        parts = [begin]
        for what, captures in (
            ("deleted", [one for one in self.left_out if one.deleted]),
            ("out", [one for one in self.left_out if not one.deleted]),
            ("back", self.taken_back),
            ("came", self.came),
            ("changed", [one for one in self.changed if one.fields]),
            ("changed somehow", [one for one in self.changed if not one.fields]),
        ):
            parts += [_said(what, of_one) for of_one in _alike(captures)]
        if self.limits:
            parts.append(message("Then limits were changed: {limits}.", limits=list(self.limits)))
        if self.cell:
            parts.append(message("Then the cell was changed: {fields:,}.", fields=list(self.cell)))
        if self.otherwise:
            parts.append(message("Then poses, files or the cell were changed; which is not known here."))
        if self.removed:
            parts.append(message("It was removed or changed since."))
        return sentences(parts)

    def __str__(self) -> str:
        return str(self.said())


_DEEDS: Final = templates({
    "deleted": "Then removed for good: {captures}.",
    "out": "Then left out: {captures}.",
    "back": "Then taken in again: {captures}.",
    "came": "Then added: {captures}.",
    "changed": "Then changed: {captures} ({fields:,}).",
    "changed somehow": "Then changed: {captures}.",
})  # fmt: skip


def _alike(captures: Iterable[LeftOut]) -> Iterator[list[LeftOut]]:
    """Give those together that the same one changed in the same way on one day for the same reason."""

    def deed(one: LeftOut) -> tuple[str, ...]:
        because = one.because or Excluded()
        return (because.who, because.why or "", because.when[:10], *one.fields)

    for _, alike in groupby(captures, deed):
        yield list(alike)


def _said(what: str, captures: Sequence[LeftOut]) -> Message:
    because, last = captures[0].because, captures[-1].because
    deed = message(_DEEDS[what], captures=Names(one.capture for one in captures), fields=captures[0].fields)
    if because is None or last is None:
        return deed
    by = message(
        "By {who} ({when}), reason: {why}.",
        who=said_who(because.who),
        when=" – ".join(dict.fromkeys(said_moment(one.when) for one in (because, last))),
        why=because.why or message("none given"),
    )
    return sentences([deed, by])
