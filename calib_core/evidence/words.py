"""Names of captures in sentences: one cause, one sentence."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

_SHORTEST_RUN: Final = 3
_MOST_NAMED: Final = 12
_NUMBER: Final = re.compile(r"[-−+±]?\d+(?:[.,]\d+)*")


def captures_text(names: Sequence[str], order: Sequence[str] = ()) -> str:
    """Return captures as a sentence names them: ``p03, p07 and p09``, or ``f13–f24`` for a run.

    Parameters
    ----------
    names : sequence of str
    order : sequence of str
        All captures as they follow each other; three or more neighbours in it are a run.
    """
    place = {name: k for k, name in enumerate(order)}
    runs: list[list[str]] = []
    for name in sorted(names, key=lambda one: place.get(one, len(place))):
        if runs and name in place and place.get(runs[-1][-1]) == place[name] - 1:
            runs[-1].append(name)
        else:
            runs.append([name])
    parts = [part for run in runs for part in ([f"{run[0]}–{run[-1]}"] if len(run) >= _SHORTEST_RUN else run)]
    if len(parts) > _MOST_NAMED:
        return f"{', '.join(parts[:_MOST_NAMED])} and {len(parts) - _MOST_NAMED} more"
    return listed(parts)


def listed(parts: Sequence[str]) -> str:
    """Return things as a sentence lists them: a, b and c."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def by_cause(causes: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the captures of each cause, the cause of most captures first; `causes` is by capture."""
    found: dict[str, list[str]] = {}
    for capture, cause in causes.items():
        found.setdefault(cause, []).append(capture)
    return dict(sorted(found.items(), key=lambda item: -len(item[1])))


@dataclass(frozen=True)
class Alike:
    """Captures of one cause: their ids, the reason of the first one, whether the others' differ in numbers."""

    captures: list[str]
    first: str
    reason: str
    differ: bool


def alike(reasons: Mapping[str, str], order: Sequence[str] = ()) -> list[Alike]:
    """Return reasons by cause, the cause of most captures first; those that differ in numbers alone are one.

    Parameters
    ----------
    reasons : mapping
        By capture.
    order : sequence of str
        All captures as they follow each other.
    """
    causes = by_cause({capture: _NUMBER.sub("#", reason) for capture, reason in reasons.items()})
    found: list[Alike] = []
    for captures in causes.values():
        first = next(name for name in [*order, *captures] if name in captures)
        differ = len({reasons[capture].removesuffix(".") for capture in captures}) > 1
        found.append(Alike(captures, first, reasons[first], differ))
    return found


def not_used(reasons: Mapping[str, str], order: Sequence[str] = ()) -> list[str]:
    """Return why captures are not used, one sentence a cause: ``p03, p07 and p09 are not used: …``.

    Reasons that differ in numbers alone are one cause, told with the first one's numbers.

    Parameters
    ----------
    reasons : mapping
        By capture, with or without a full stop.
    order : sequence of str
        All captures as they follow each other.
    """
    sentences: list[str] = []
    for one in alike(reasons, order):
        count = len(one.captures)
        what = f"{captures_text(one.captures, order)} {'is' if count == 1 else 'are'} not used"
        alike_words = f" (in {one.first}; the others alike)" if one.differ else ""
        many = f" ({count} captures)" if count > _SHORTEST_RUN else ""
        sentences.append(f"{what}{many}: {one.reason.removesuffix('.')}{alike_words}.")
    return sentences


def by_to_do(descriptions: Sequence[str]) -> list[str]:
    """Return what is open, one sentence each thing to do: ``the rotation about x (±1°) and y (±2°): turn it``.

    Each description is what is open, a colon, and what to do.
    """
    groups: dict[str, list[str]] = {}
    for description in descriptions:
        what, _, to_do = description.rpartition(": ")
        groups.setdefault(to_do, []).append(what)
    return [f"{listed(_without_repeats(whats))}: {to_do}" for to_do, whats in groups.items()]


def _without_repeats(texts: Sequence[str]) -> list[str]:
    """Return texts, those after the first without the words that all begin with."""
    words = [text.split(" ") for text in texts]
    alike = 0
    while len(words) > 1 and all(len(w) > alike + 1 and w[alike] == words[0][alike] for w in words):
        alike += 1
    return [texts[0], *(" ".join(w[alike:]) for w in words[1:])]


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: ``1 capture``, ``3 captures``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
