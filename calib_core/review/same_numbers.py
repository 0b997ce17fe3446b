"""Whether two results of a stage are the same within rounding: value by value, by the spreads that they state."""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final, Literal, cast

import numpy as np
from pydantic import Field

from calib_core.errors import CalibrationError
from calib_core.frames import RigidTransform
from calib_core.messages import SAID
from calib_core.records import Record
from calib_core.records.findings import Finding

SIGMAS: Final = 1e-3
"""A frame is equal where it lies within this many of its stated standard deviations along each axis, a covariance
where its elements differ by less than this of the standard deviations of their row and column; lengths and angles
where they differ by less than this of the smallest standard deviation that the result states."""

TOLERANCE: Final = 1e-6
"""Other numbers are equal where they differ by less than this, relative to the larger: processors do, by 1e-9."""

ROUNDING: Final = 1e-9
"""Or by less than this, relative to the largest number of their vector or matrix: a zero is never quite zero."""

_EXACTLY: Final = 1e-6
"""What is known so much better than its neighbours has rounding for a sigma, which no two processors share."""

SPREAD: Final = 1e-4
"""What measures a spread is equal within this, relative to the larger: nobody knows a sigma better."""
MAX_LISTED: Final = 100
_ABOUT: Final = ("software", "method", "method_revision", "inputs_sha256", "solved", "provenance", "seal", SAID)
_NOTHING: Final[tuple[Any, ...]] = (None, [], {})
_TEXTS: Final = ("title", "sentence", "reason", "description")  # within records; what they tell is compared

WORDS: Final = ("findings", "warnings", "notes", "causes", "evidence")
"""What tells numbers and codes in words, which versions put otherwise: of findings the codes are compared."""

_SPREADS: Final = re.compile(
    r"sigma|rms|covariance|variance|chance|mahalanobis|weight|scatter|uncertainty|expected|share|component|budget"
)
_IN_FRAME: Final = re.compile(r"^frames\[[^\]]*\]\.matrix\[\d\]\[(\d)\]$")
_OPTICS: Final = re.compile(r"^optics\[\d+\]\.(?:(?:tool|turntable)\[(\d)\]|by_place)")
_UNIT: Final = re.compile(r"_(mm|rad|deg)(?:\[[^.\]]*\])*$")
_MISSING: Final = object()


class ReplayDifference(Record):
    """One value that came out otherwise; null where it is missing on one side."""

    path: str
    stored: Any = None
    fresh: Any = None
    relative: float | None = None


class StageReplay(Record):
    """How one stage compares.

    `largest_relative` is of all numbers, those held for equal too; `differences` lists the worst; `why` says what
    the records themselves know of the reason.  `provenance` is what the result is by it, `replayed` or `differs`;
    null where nothing can be said, since its captures changed or it cannot be solved any more.  `finding` says how
    far it differs, or how far a newer method moved it.
    """

    stage: str
    equal: bool
    numbers: int = 0
    largest_relative: float = 0.0
    difference_count: int = 0
    differences: list[ReplayDifference] = Field(default_factory=list[ReplayDifference])
    why: list[str] = Field(default_factory=list)
    provenance: Literal["replayed", "differs"] | None = None
    finding: Finding | None = None


def compare(stored: Mapping[str, Any], fresh: Mapping[str, Any]) -> StageReplay:
    """Return how two results of a stage compare, value by value, given as JSON data."""
    numbers, largest, count = 0, 0.0, 0
    differences: list[ReplayDifference] = []
    same = tuple(f"{name}[" for name in _same_frames(stored, fresh))
    sigmas = _stated_sigmas(fresh)
    for path, a, b, allowed in _pairs(_compared(stored), _compared(fresh)):
        if _is_number(a) and _is_number(b):
            relative = _relative(a, b)
            numbers += 1
            if (
                relative <= _relative_allowed(path, a)
                or path.startswith(same)
                or (isinstance(a, float) and abs(a - b) <= max(allowed, SIGMAS * _sigma_of(path, sigmas)))
            ):
                largest = max(largest, min(relative, TOLERANCE))
                continue
            largest = max(largest, relative)
        elif a is not _MISSING and b is not _MISSING and type(a) is type(b) and a == b:
            continue
        else:
            relative = None
        count += 1
        told = [None if value is _MISSING else value for value in (a, b)]
        differences.append(ReplayDifference(path=path, stored=told[0], fresh=told[1], relative=relative))
    differences.sort(key=lambda row: -math.inf if row.relative is None else -row.relative)
    return StageReplay(
        stage=str(stored.get("stage", "")),
        equal=not count,
        numbers=numbers,
        largest_relative=largest,
        difference_count=count,
        differences=differences[:MAX_LISTED],
    )


def _same_frames(stored: Mapping[str, Any], fresh: Mapping[str, Any]) -> Iterator[str]:
    """Give the names of the frames that are equal by their stated standard deviations."""
    from calib_core.graph.registry import STAGES

    stage = str(stored.get("stage", ""))
    if stage not in STAGES.names():
        return
    for name, sigmas in frame_sigmas(stage, stored, fresh):
        if sigmas <= SIGMAS:
            yield name


def _compared(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is compared of a result: all but what explains a difference, and of findings the codes."""
    kept = {name: value for name, value in result.items() if name not in (*_ABOUT, *WORDS)}
    if result.get("findings"):
        kept["findings"] = " ".join(sorted({finding["code"] for finding in result["findings"]}))
    return kept


def _stated_sigmas(fresh: Mapping[str, Any]) -> dict[str, float]:
    """Return the smallest standard deviations that a result states of a length and of an angle, 0 where none."""
    rotations: list[float] = []
    shifts: list[float] = []
    for name, matrix in fresh.items():
        if name.endswith("covariance") and isinstance(matrix, list) and len(cast("list[Any]", matrix)) in (6, 12):
            for k, row in enumerate(cast("list[list[float]]", matrix)):
                (rotations if k % 6 < 3 else shifts).append(math.sqrt(max(row[k] or 0.0, 0.0)))
    length, angle = (min((x for x in found if x > 1e-9), default=0.0) for found in (shifts, rotations))
    return {"mm": length, "rad": angle, "deg": math.degrees(angle)}


def _sigma_of(path: str, sigmas: Mapping[str, float]) -> float:
    """Return the standard deviation that counts for a number, by the unit that ends its name."""
    if element := _IN_FRAME.search(path):
        return sigmas["mm" if element[1] == "3" else "rad"]
    if moved := _OPTICS.search(path):  # a move of six, or by how much a shift grows with the place: like an angle
        return sigmas["mm" if moved[1] in tuple("345") else "rad"]
    unit = _UNIT.search(path)
    return sigmas[unit[1]] if unit else 0.0


def _relative_allowed(path: str, value: float) -> float:
    """Return how far a number may be off, relative to itself; counts must be the same."""
    if isinstance(value, int):
        return 0.0
    return SPREAD if _SPREADS.search(path.rpartition(".")[2]) else TOLERANCE


def frame_sigmas(stage: str, stored: Mapping[str, Any], fresh: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Give the frames that both results have, and how far they lie apart in the new one's sigmas."""
    from calib_core.exports.workpiece import covariance_in
    from calib_core.review.compare import frame_difference, frames_of

    for name, into, outof, covariance in frames_of(stage):
        if stored.get(name) is None or fresh.get(name) is None:
            continue
        try:
            left, right = (RigidTransform.from_rounded(one[name], into, outof) for one in (stored, fresh))
            known = np.asarray(covariance_in(fresh, covariance))
        except CalibrationError:  # an altered one may be no frame any more
            continue
        axes = frame_difference(name, (left, right), known, np.zeros(3)).axes
        free = any(axis.sigmas is None and abs(axis.difference) > TOLERANCE for axis in axes)
        yield name, math.inf if free else max(abs(axis.sigmas or 0.0) for axis in axes)


def _pairs(a: Any, b: Any, path: str = "", size: float = 0.0) -> Iterator[tuple[str, Any, Any, float]]:
    """Give every value of two trees with its path and how far it may be off for where it stands.

    `size` is the largest number of the array that it stands in.
    """
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        left, right = cast("Mapping[str, Any]", a), cast("Mapping[str, Any]", b)
        for name in left:
            if name in _TEXTS or name not in right or (left[name] in _NOTHING and right[name] in _NOTHING):
                continue  # a field that only one version writes, or that says nothing, is no difference
            place = f"{path}.{name}" if path else name
            yield from _pairs(left[name], right[name], place)
    elif isinstance(a, list) and isinstance(b, list):
        left_items, right_items = cast("list[Any]", a), cast("list[Any]", b)
        if _is_covariance(path, left_items) and _is_covariance(path, right_items):
            yield from _covariance_pairs(left_items, right_items, path)
            return
        size = size or max(_largest(left_items), _largest(right_items))
        for k in range(max(len(left_items), len(right_items))):
            left_item = left_items[k] if k < len(left_items) else _MISSING
            right_item = right_items[k] if k < len(right_items) else _MISSING
            yield from _pairs(left_item, right_item, f"{path}[{_label(left_item, k)}]", size)
    else:
        yield path, a, b, ROUNDING * size


def _is_covariance(path: str, items: list[Any]) -> bool:
    """Return whether this is a matrix of numbers by the name of a covariance."""
    square = all(isinstance(row, list) and len(cast("list[Any]", row)) == len(items) for row in items)
    return path.endswith("covariance") and bool(items) and square and all(_is_number(x) for r in items for x in r)


def _covariance_pairs(
    left: list[list[float]], right: list[list[float]], path: str
) -> Iterator[tuple[str, Any, Any, float]]:
    """Give the elements of two covariances, each with the product of the sigmas of its row and its column."""
    if len(left) != len(right):
        yield path, left, right, 0.0
        return
    sigmas = [math.sqrt(max(abs(left[k][k]), abs(right[k][k]))) for k in range(len(left))]
    largest = [max(sigmas[k - k % 3 : k - k % 3 + 3]) for k in range(len(left))]
    sigmas = [max(*pair) for pair in zip(sigmas, (_EXACTLY * sigma for sigma in largest), strict=True)]
    for k, rows in enumerate(zip(left, right, strict=True)):
        for column, (a, b) in enumerate(zip(*rows, strict=True)):
            yield f"{path}[{k}][{column}]", a, b, SIGMAS * sigmas[k] * sigmas[column]


def _label(item: Any, index: int) -> str:
    return str(cast("Mapping[str, Any]", item).get("capture", index)) if isinstance(item, Mapping) else str(index)


def _largest(items: list[Any]) -> float:
    """Return the largest magnitude in a vector or a matrix, nothing where records stand in the list."""
    largest = 0.0
    for item in items:
        if isinstance(item, list):
            largest = max(largest, _largest(cast("list[Any]", item)))
        elif _is_number(item):
            largest = max(largest, abs(item))
    return largest


def _relative(a: float, b: float) -> float:
    return 0.0 if a == b else abs(a - b) / max(abs(a), abs(b))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
