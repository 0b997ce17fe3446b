"""Measurements paired with poses: by name, by number (1, 2, 10), by time, else by their order."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Literal

from calib_core.recognition.taken import PoseRow, Reason, stem_of

By = Literal["name", "number", "time", "order"]

_DIGITS = re.compile(r"(\d+)")
_LAST_NUMBER = re.compile(r"(\d{1,9})\D*\Z")
_MOMENT = re.compile(
    r"(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?([0-2]\d|3[01])[-_. T]?"
    r"([01]\d|2[0-3])[-_.:h]?([0-5]\d)[-_.:m]?([0-5]\d)(?:[._-]?(\d{1,6}))?"
)
_NAMED_SHARE = 0.5  # of the rows whose names are those of measurements


@dataclass(frozen=True)
class Pairs:
    """Which row belongs to which measurement, by their places; `by` says how, `doubt` what is open about it."""

    row_of: dict[int, int]
    by: By
    doubt: Reason | None = None


def natural(name: str) -> tuple[tuple[int, int | str], ...]:
    """Return what orders names as people count: p2 before p10."""
    return tuple((0, int(part)) if part.isdigit() else (1, part.lower()) for part in _DIGITS.split(name) if part)


def paired(names: Sequence[str], rows: Sequence[PoseRow]) -> Pairs:
    """Return which pose each measurement has.

    Parameters
    ----------
    names : sequence of str
        Of the measurements, in their natural order.
    rows : sequence of PoseRow
        In the order of their file.
    """
    for way in (_by_name, _by_number, _by_time, _by_place):
        found = way(names, rows)
        if found is not None:
            return found
    return _by_order(names, rows)


def _by_name(names: Sequence[str], rows: Sequence[PoseRow]) -> Pairs | None:
    places: dict[str, int | None] = {}
    for place, name in enumerate(names):
        for key in {name.lower(), name.rpartition("/")[2].lower(), stem_of(name).lower()}:
            places[key] = None if key in places else place  # one of several is none
    matched: dict[int, int] = {}
    for k, row in enumerate(rows):
        place = places.get(row.name.lower().strip())
        place = places.get(stem_of(row.name.lower())) if place is None else place
        if place is not None and place not in matched:
            matched[place] = k
    named = [row for row in rows if row.name]
    enough = len(matched) >= _NAMED_SHARE * min(len(named), len(names))
    return Pairs(matched, "name") if matched and enough else None


def _by_number(names: Sequence[str], rows: Sequence[PoseRow]) -> Pairs | None:
    """Pair by the numbers that rows and names both end in, where every measurement's number is a row's."""
    counted = [row.number if row.number is not None else _number(row.name) for row in rows]
    return _of_numbers(_numbers_of(names), counted)


def _by_place(names: Sequence[str], rows: Sequence[PoseRow]) -> Pairs | None:
    """Pair by the names' numbers as places of rows, where numbers are left out: p1, p2, p4 and four rows."""
    numbers = _numbers_of(names)
    if None in numbers or len(names) >= len(rows):
        return None
    first = 0 if 0 in numbers else 1
    return _of_numbers(numbers, [first + k for k in range(len(rows))])


def _of_numbers(numbers: Sequence[int | None], counted: Sequence[int | None]) -> Pairs | None:
    row_of = {number: k for k, number in enumerate(counted) if number is not None}
    if None in numbers or len(set(numbers)) < len(numbers) or len(row_of) < len(counted):
        return None
    matched = {place: row_of[n] for place, n in enumerate(numbers) if n is not None and n in row_of}
    return Pairs(matched, "number") if len(matched) == len(numbers) else None


def _numbers_of(names: Sequence[str]) -> list[int | None]:
    """Return the number that tells each name from the others: the last one that is not the same in all."""
    stems = [_DIGITS.split(stem_of(name)) for name in names]
    if len(names) > 1 and len({len(parts) for parts in stems}) == 1:
        for at in range(len(stems[0]) - 1, 0, -1):
            if at % 2 and len({parts[at] for parts in stems}) == len(names):
                return [int(parts[at]) for parts in stems]
    return [_number(stem_of(name)) for name in names]


def _number(name: str) -> int | None:
    found = _LAST_NUMBER.search(name)
    return int(found[1]) if found else None


def moment_s(name: str) -> float | None:
    """Return the time that stands in a name, in seconds since 1970; None where none does."""
    found = _MOMENT.search(name)
    if not found:
        return None
    try:
        moment = datetime(*(int(part) for part in found.groups()[:6]), tzinfo=UTC)  # type: ignore[arg-type]
    except ValueError:
        return None
    return moment.timestamp() + (float(f"0.{found[7]}") if found[7] else 0.0)


def _by_time(names: Sequence[str], rows: Sequence[PoseRow]) -> Pairs | None:
    """Pair each measurement with the pose nearest in time, where both have times in one clock."""
    read: Callable[[str], float | None] = moment_s
    times = [read(stem_of(name)) for name in names]
    stamps = [row.time_s if row.time_s is not None else read(row.name) for row in rows]
    if None in times or None in stamps or len(names) < 2 or len(rows) < 2:
        return None
    known = [float(s) for s in stamps if s is not None]
    apart_s = sorted(b - a for a, b in pairwise(sorted(known)))
    most_s = max(apart_s[len(apart_s) // 2] / 2, 0.5)
    matched: dict[int, int] = {}
    for place, time_s in enumerate(times):
        apart = [abs(stamp - (time_s or 0.0)) for stamp in known]
        nearest = min(range(len(known)), key=apart.__getitem__)
        if apart[nearest] <= most_s:
            matched[place] = nearest
    whole = len(set(matched.values())) == len(matched) and len(matched) >= 0.8 * min(len(names), len(rows))
    return Pairs(matched, "time") if whole else None


def _by_order(names: Sequence[str], rows: Sequence[PoseRow]) -> Pairs:
    count = min(len(names), len(rows))
    uneven = Reason("paired-by-order", {"measurements": len(names), "poses": len(rows)})
    doubt = None if len(names) == len(rows) else uneven
    return Pairs({k: k for k in range(count)}, "order", doubt)
