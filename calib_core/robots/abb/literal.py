"""RAPID literals: lists in brackets with the places of their items."""

from dataclasses import dataclass

from calib_core.messages import message
from calib_core.robots.phrases import UNMATCHED
from calib_core.robots.text import closing, split_top


@dataclass(frozen=True)
class Value:
    """A literal: its items for a list, its text otherwise, and where it stands."""

    position: int
    text: str
    items: tuple["Value", ...] | None


def literal(text: str, begin: int, end: int) -> Value:
    """Return the literal between two positions; raises ValueError where brackets do not match."""
    while begin < end and text[begin].isspace():
        begin += 1
    raw = text[begin:end].rstrip()
    if not raw:
        raise ValueError(message("a value is missing"))
    if raw[0] != "[":
        if any(c in raw for c in "[]"):
            raise ValueError(message("'{left}' cannot be read", left=" ".join(raw.split())[:40]))
        return Value(begin, raw, None)
    if closing(raw, 0, ";") != len(raw):
        raise ValueError(UNMATCHED)
    items = tuple(literal(text, begin + 1 + p, begin + 1 + p + len(s)) for p, s in split_top(raw[1:-1]))
    return Value(begin, raw, items)
