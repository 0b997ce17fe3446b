"""Limits of a verification that were changed after its first capture: which, when, and what is said of it.

Who sets a limit and knows the captures can set it so that they pass.  A change is therefore not refused, since
limits are told wrongly too, but kept with the session and said wherever the decision stands.
"""

from collections.abc import Sequence
from typing import Any, Final

from calib_core.evidence.numbers import fixed
from calib_core.findings import Code, Finding
from calib_core.findings.codes.verify import LIMIT_CHANGED, LIMIT_EASED
from calib_core.messages import Message, message, sentences
from calib_core.records import LimitChange, Verification
from calib_core.records.acting import said_who
from calib_core.records.evidence import AnyBlock, Column, Row, Table

_NAMES: Final = {
    "tool_mm": message("limit of the tool's error at the sphere"),
    "form_mm": message("limit of the probing form"),
    "form_95_mm": message("limit of the probing form of 95 %"),
    "size_mm": message("limit of the probing size"),
    "spacing_mm": message("limit of the sphere spacing"),
    "flatness_mm": message("limit of the flatness"),
    "flatness_95_mm": message("limit of the flatness of 95 %"),
    "ball_bar_mm": message("ball bar's calibrated length"),
    "ball_bar_sigma_mm": message("uncertainty of the ball bar's length"),
}
_REFERENCES: Final = ("ball_bar_mm", "ball_bar_sigma_mm")
LIMITS: Final = tuple(name for name in _NAMES if name not in _REFERENCES)
"""The fields of `cell.verification` that are limits."""


def changes_between(
    before: Verification, after: Verification, captures: int, at: str, who: str, why: str = ""
) -> list[LimitChange]:
    """Return what differs between two settings of the limits, `captures` having been taken for them."""
    if not captures:
        return []
    pairs = {name: (getattr(before, name), getattr(after, name)) for name in _NAMES}
    return [
        LimitChange(at=at, who=who, why=why or None, field=name, before_mm=old, after_mm=new, captures=captures)
        for name, (old, new) in pairs.items()
        if old != new
    ]


def limit_findings(limits: Verification) -> list[Finding]:
    """Return the changes that were kept with the limits: those that let more pass now are doubts."""
    changes = limits.changes or []
    return [
        _found(change, LIMIT_EASED if _is_easier(change.field, changes) else LIMIT_CHANGED) for change in changes
    ]


def changes_table(limits: Verification) -> list[AnyBlock]:
    """Return the changes as a table, nothing where there were none."""
    if not limits.changes:
        return []
    rows = [
        Row(
            cells=[
                change.at,
                change.who,
                _name(change.field),
                *(None if value is None else f"{value:g} mm" for value in (change.before_mm, change.after_mm)),
                fixed(change.captures, 0),
                change.why or "",
            ]
        )
        for change in limits.changes
    ]
    texts = [Column(label=label, align="left", own=label == "By") for label in ("When", "By", "What")]
    numbers = [Column(label=label) for label in ("Before", "After", "Captures then")]
    title = "Limits changed after the first capture"
    columns = [*texts, *numbers, Column(label="Why", align="left", own=True)]
    return [Table(id="limit_changes", title=title, columns=columns, rows=rows)]


def said_change(change: LimitChange) -> Message:
    """Return one change with who made it and why, as sentences."""
    said = LIMIT_CHANGED.as_message(LIMIT_CHANGED.text, _values(change), ())
    why = change.why or message("none given")
    return sentences([said, message("By {who}, reason: {why}.", who=said_who(change.who), why=why)])


def _is_easier(field: str, changes: Sequence[LimitChange]) -> bool:
    """Return whether a limit lets more pass now than before the first capture, or judges what it did not."""
    own = [change for change in changes if change.field == field]
    first, last = own[0].before_mm, own[-1].after_mm
    if first == last or field in _REFERENCES:
        return False
    return first is None or last is None or last > first


def _found(change: LimitChange, code: Code) -> Finding:
    return code(**_values(change))


def _values(change: LimitChange) -> dict[str, Any]:
    figures = {"before_mm": change.before_mm, "after_mm": change.after_mm}
    known = {name: value for name, value in figures.items() if value is not None}
    how = "set" if change.before_mm is None else "removed" if change.after_mm is None else "changed"
    return {"how": how, "what": _name(change.field), "count": change.captures, **known}


def _name(field: str) -> str:
    return _NAMES.get(field, field)
