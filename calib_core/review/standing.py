"""Faults of the moment: how an answer stands today, by its cell's history, its policy and its equipment."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from calib_core.messages import Message, message, sentences
from calib_core.moment import said_moment
from calib_core.records.acting import said_who
from calib_core.records.faults import in_order
from calib_core.records.policy import Equipment, Policy

_VERIFIED = ("pass", "conditional-pass")
_ACKNOWLEDGED = {
    "drift": message("Change of the cell acknowledged by {who}, {when}. Reason: {why}"),
    "equipment-changed": message("Other equipment ({changes}) acknowledged by {who}, {when}. Reason: {why}"),
}


@dataclass(frozen=True)
class Standing:
    """What is known of a cell at this moment.

    Attributes
    ----------
    policy : Policy
    steps : frozenset of str
        Sessions with which the cell's figures changed, and that nobody has acknowledged.
    serials : mapping
        Of the equipment that an answer is held against, by kind and name: of the answer in force for a new one, of
        the newest session for the one in force.
    acknowledged : frozenset of str
        Changes of equipment that were acknowledged since.
    """

    policy: Policy = field(default_factory=Policy)
    steps: frozenset[str] = frozenset()
    serials: Mapping[str, str] = field(default_factory=dict[str, str])
    acknowledged: frozenset[str] = frozenset()


def faults_of_moment(
    answer: Mapping[str, Any], standing: Standing, now: datetime | None = None
) -> tuple[str, ...]:
    """Return the faults of the moment of an answer, a `SessionAnswer` as JSON data."""
    decision = answer.get("decision")
    changed = changed_equipment(standing.serials, serials_of(answer.get("equipment") or ()))
    needed = "verify" in standing.policy.needs and decision not in ("fail", "conditional-fail")
    holds = {
        "drift": bool(standing.steps),
        "overdue": _is_overdue(answer, standing.policy, now or datetime.now(UTC)),
        "equipment-changed": bool(changed - standing.acknowledged),
        "verify-undecided": needed and decision not in _VERIFIED,
    }
    return in_order(name for name, held in holds.items() if held)


def serials_of(equipment: Iterable[Equipment | Mapping[str, Any]]) -> dict[str, str]:
    """Return the serial numbers of equipment by kind and name, or serial number of what has no name.

    Pieces without a serial number say nothing.
    """
    pieces = [Equipment.model_validate(one) if isinstance(one, Mapping) else one for one in equipment]
    return {f"{one.kind} {one.name or one.serial}": one.serial for one in pieces if one.serial}


def changed_equipment(before: Mapping[str, str], now: Mapping[str, str]) -> frozenset[str]:
    """Return what was replaced, each as "kind name serial → kind name serial".

    A piece has another serial number under its name; or one of its kind is gone where another has come, however
    both are named.
    """
    renamed = {name for name in now if name in before and before[name] != now[name]}
    pairs = [(name, name) for name in sorted(renamed)]
    gone = [name for name in before if name not in renamed and before[name] not in now.values()]
    for new in (name for name in now if name not in renamed and now[name] not in before.values()):
        old = next((name for name in gone if _kind(name) == _kind(new)), None)
        if old is not None:
            gone.remove(old)
            pairs.append((old, new))
    return frozenset(" → ".join(sorted((_said(a, before[a]), _said(b, now[b])))) for a, b in pairs)


def _said(name: str, serial: str) -> str:
    return name if name.endswith(f" {serial}") else f"{name} {serial}"


def _kind(name: str) -> str:
    return name.split(" ", 1)[0]


def _is_overdue(answer: Mapping[str, Any], policy: Policy, now: datetime) -> bool:
    """Return whether the interval has passed since the answer was solved, or last verified with success."""
    if policy.interval_days is None:
        return False
    dates = [answer.get("solved"), answer.get("verified") if answer.get("decision") in _VERIFIED else None]
    told = [datetime.fromisoformat(date) for date in dates if date]
    newest = max((one if one.tzinfo else one.replace(tzinfo=UTC) for one in told), default=None)
    return newest is None or now - newest > timedelta(days=policy.interval_days)


def said_acknowledgement(told: Mapping[str, Any]) -> Message:
    """Return who acknowledged a fault of the moment, when and why: `fault`, `of`, `who`, `created`, `why`."""
    return message(
        _ACKNOWLEDGED[told["fault"]],
        changes="; ".join(told["of"]),
        who=said_who(str(told["who"])),
        when=said_moment(str(told["created"])),
        why=str(told["why"]) or message("none given"),
    )


def said_signed(said: Message, told: Mapping[str, Any]) -> Message:
    """Return what is said of what came with an archive; that nobody signed it, where `signed` is false."""
    if told.get("signed", True):
        return said
    return sentences([said, message("Nobody who is trusted here has signed this as it stands.")])


def said_release(release: Mapping[str, Any]) -> Message:
    """Return who released an answer, when and why: `number`, `who`, `created`, `why`."""
    return message(
        "Release {number} by {who}, {when}. Reason: {why}",
        number=int(release["number"]),
        who=said_who(str(release["who"])),
        when=said_moment(str(release["created"])),
        why=str(release["why"]) or message("none given"),
    )
