"""A decision of a verification after which its evidence was changed."""

from typing import Final

from pydantic import Field

from calib_core.messages import Message, Names, message, sentences, templates
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
    """A capture that was left out after a decision, or taken in again, and why where that was told."""

    capture: str
    because: Excluded | None = None


class DecidedBefore(Record):
    """A decision that was made before captures were left out or added, or a limit was changed (by figure).

    `taken_back` are those of `added` that had been left out before; `removed` is whether all that is left of it is
    what a later one's seal says; `text` says it all.
    """

    decision: str
    solved: str | None = None
    left_out: list[LeftOut] = Field(default_factory=list[LeftOut])
    added: list[str] = Field(default_factory=list[str])
    limits: list[str] = Field(default_factory=list[str])
    taken_back: list[LeftOut] = Field(default_factory=list[LeftOut])
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
        parts = [begin, *(_left_out(one) for one in self.left_out)]
        parts += [_taken_back(one) for one in self.taken_back]
        again = {one.capture for one in self.taken_back}
        if new := [name for name in self.added if name not in again]:
            parts.append(message("Then {captures} came.", captures=Names(new)))
        if self.limits:
            parts.append(message("Then limits were changed: {limits}.", limits=list(self.limits)))
        if self.removed:
            parts.append(message("It was removed or changed since."))
        return sentences(parts)

    def __str__(self) -> str:
        return str(self.said())


def _left_out(one: LeftOut) -> Message:
    because = one.because
    if because is None:
        return message("Then {capture} was left out.", capture=one.capture)
    return message(
        "Then {capture} was left out by {who} ({when}), reason: {why}.",
        capture=one.capture,
        who=because.who or message("nobody known"),
        when=because.when[:16].replace("T", " "),
        why=because.why or message("none given"),
    )


def _taken_back(one: LeftOut) -> Message:
    because = one.because or Excluded()
    return message(
        "Then {capture} was taken in again by {who} ({when}), reason: {why}.",
        capture=one.capture,
        who=because.who or message("nobody known"),
        when=because.when[:16].replace("T", " "),
        why=because.why or message("none given"),
    )
