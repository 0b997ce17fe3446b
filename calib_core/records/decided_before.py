"""A decision of a verification after which its evidence was changed."""

from pydantic import Field

from calib_core.records.base import Record
from calib_core.records.policy import Excluded


class LeftOut(Record):
    """A capture that was left out after a decision, and why where that was told."""

    capture: str
    because: Excluded | None = None


class DecidedBefore(Record):
    """A decision that was made before captures were left out or added, or a limit was changed (by figure)."""

    decision: str
    solved: str | None = None
    left_out: list[LeftOut] = Field(default_factory=list[LeftOut])
    added: list[str] = Field(default_factory=list[str])
    limits: list[str] = Field(default_factory=list[str])

    def __str__(self) -> str:
        parts = [f"{one.capture} was left out{_because(one.because)}" for one in self.left_out]
        parts += [f"{name} was added" for name in self.added]
        parts += [f"the limit of {name} was changed" for name in self.limits]
        when = f" of {self.solved[:16].replace('T', ' ')} UTC" if self.solved else ""
        return f"After the decision {self.decision.replace('-', ' ')}{when}: {'; '.join(parts)}."


def _because(because: Excluded | None) -> str:
    if because is None:
        return ""
    when = f" on {because.when[:16].replace('T', ' ')}" if because.when else ""
    return f" by {because.who}{when}, {'because: ' + because.why if because.why else 'no reason given'}"
