"""Poses among rows of numbers: which columns they are, and in which conventions they can be written."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib_core.poses.conventions import CONVENTIONS
from calib_core.recognition.number_rows import TIME, Row, Rows, counts_up, rises
from calib_core.recognition.taken import PoseList, PoseRow
from calib_core.robots.table.columns import joint_columns, plain, unit_of

_UNIT = 1e-2
_MOST_POSES = 20_000
_MOST_TURN_DEG = 361.0
_FARTHEST = 20_000.0
_SAME = {
    "tx": "x", "ty": "y", "tz": "z", "px": "x", "py": "y", "pz": "z",
    "roll": "w", "pitch": "p", "yaw": "r",  # about the fixed x, y and z
}  # fmt: skip
_TIMES = {"t", "time", "timestamp", "time_s", "t_s", "stamp"}
_NAMES = {"name", "id", "file", "capture", "profile", "filename", "pose", "point"}
_MOST_UNNAMED = 200
_OF_CLOUD = re.compile(
    r"n[xyz]|[ijkruvg]$|normal|red|green|blue|colou?r|int|grey|gray|refl|width|qual|conf|row|col|line|class|return|scal"
)
_COUNTS = {"nr", "no", "number", "index", "idx", "i", "n", "#"}


def poses_in(found: Rows, file: str) -> PoseList | None:
    """Return the poses that rows hold, None where they hold none."""
    if not found.rows or len(found.rows) > _MOST_POSES or found.others > max(3, len(found.rows)):
        return None
    found = _with_uneven(found)
    rows = found.rows
    labels = rows[0].labels
    if labels and all(row.labels == labels for row in rows):
        return _named(found, labels, file)
    if (columns := _columns(found)) is not None:
        return _named(found, columns, file)
    return _bare(rows, file)


def _with_uneven(found: Rows) -> Rows:
    """Return rows among which those that are not whole keep their places: what is in order stays in order."""
    if not found.uneven or len(found.uneven) > max(3, len(found.rows) // 4):
        return found
    first = found.rows[0]
    blanks = (math.nan,) * found.width
    whole = [
        replace(row, numbers=(*row.numbers, *blanks)[: found.width], labels=first.labels, behind=())
        for row in found.uneven
        if len(row.numbers) < found.width
    ]
    return replace(found, rows=tuple(sorted((*found.rows, *whole), key=lambda row: row.line)))


def _whole(values: np.ndarray) -> np.ndarray:
    """Return the rows without a blank."""
    return values[np.isfinite(values).all(axis=1)]


def poses_of_numbers(rows: Sequence[Sequence[float]], names: Sequence[str], file: str) -> PoseList | None:
    """Return the poses that lists of numbers without column names are; None where they are none."""
    listed = tuple(
        Row(k, (name,) if name else (), tuple(map(float, row)))
        for k, (row, name) in enumerate(zip(rows, names, strict=True), start=1)
    )
    return _bare(listed, file) if listed else None


def _columns(found: Rows) -> tuple[str, ...] | None:
    """Return the names of the numbers' columns, without those of the words before them."""
    words, behind = len(found.rows[0].words), len(found.rows[0].behind)
    if len(found.names) - found.width - words not in (0, behind):
        return None
    return tuple(found.names[words : words + found.width])


def _named(found: Rows, names: Sequence[str], file: str) -> PoseList | None:
    """Return poses whose numbers are named."""
    plains = [_SAME.get(plain(name), plain(name)) for name in names]
    fitting: dict[tuple[int, ...], list[str]] = {}
    for convention in CONVENTIONS.values():
        wanted = [name.lower() for name in convention.numbers.split()]
        if convention.form != "matrix" and all(plains.count(name) == 1 for name in wanted):
            fitting.setdefault(tuple(plains.index(name) for name in wanted), []).append(convention.name)
    if not fitting:
        return _turned_somehow(found, plains, file)
    places, conventions = max(fitting.items(), key=lambda one: len(one[1]))
    unit = unit_of(names[places[0]])
    conventions = _of_unit(conventions, unit, [[row.numbers[p] for p in places[:3]] for row in found.rows])
    first = CONVENTIONS[conventions[0]]
    factor = 1000.0 if unit == "m" and first.mm_per_unit == 1 else 1.0
    in_radians = unit_of(names[places[3]]) == "rad" and first.form not in ("rotation-vector", "quaternion")
    factors = [factor] * 3 + [math.degrees(1.0) if in_radians else 1.0] * (len(places) - 3)
    rows = [
        PoseRow(tuple(row.numbers[p] * f for p, f in zip(places, factors, strict=True)), row.line, file=file)
        for row in found.rows
    ]
    rows = _with_joints(found.rows, rows, names, set(places))
    return PoseList(
        tuple(_beside(found.rows, rows, plains, set(places))), tuple(conventions), not unit_of(names[places[3]])
    )


def _turned_somehow(found: Rows, plains: Sequence[str], file: str) -> PoseList | None:
    """Return poses of rows with x, y, z and three or four further columns under names that no convention has.

    A point of a cloud has other things beside its place: these are known by name, and are many.
    """
    beside = {*_TIMES, *_NAMES, *_COUNTS, "table", "table_deg", "turntable"}
    turns = [k for k, name in enumerate(plains) if name not in (*"xyz", *beside)]
    clear = all(plains.count(axis) == 1 for axis in "xyz") and len(turns) in (3, 4)
    if not clear or len(found.rows) > _MOST_UNNAMED or any(_OF_CLOUD.match(plains[k]) for k in turns):
        return None
    places = [*map(plains.index, "xyz"), *turns]
    values = _whole(np.array([[row.numbers[p] for p in places] for row in found.rows]))
    conventions = _conventions(values) if len(values) else ()
    if not conventions:
        return None
    rows = [PoseRow(tuple(row.numbers[p] for p in places), row.line, file=file) for row in found.rows]
    return PoseList(tuple(_beside(found.rows, rows, plains, set(places))), conventions, len(turns) == 3)


def _of_unit(conventions: list[str], unit: str, positions: Sequence[Sequence[float]]) -> list[str]:
    """Return those of the conventions that have the unit that a header states, or that positions leave."""
    near = max(math.dist(p, (0, 0, 0)) for p in positions if all(map(math.isfinite, p))) if positions else 0.0
    metres = unit == "m" or (not unit and 0 < near < 15)
    fitting = [name for name in conventions if (CONVENTIONS[name].mm_per_unit == 1000) == metres]
    return fitting or conventions


def _beside(given: Sequence[Row], rows: list[PoseRow], plains: Sequence[str], used: set[int]) -> list[PoseRow]:
    """Return the rows with the names, counts and times that stand beside their numbers."""
    for place, name in enumerate(plains):
        if place in used:
            continue
        values = [row.numbers[place] for row in given]
        if name in _TIMES:
            rows = [replace(row, time_s=_known(v)) for row, v in zip(rows, values, strict=True)]
        elif name in _COUNTS or (name in _NAMES and all(v == int(v) for v in values if math.isfinite(v))):
            rows = [replace(row, number=_whole_number(v)) for row, v in zip(rows, values, strict=True)]
        elif name in ("table", "table_deg", "turntable"):
            rows = [replace(row, table_deg=_known(v), has_table=True) for row, v in zip(rows, values, strict=True)]
    return _with_words(given, rows)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _whole_number(value: float) -> int | None:
    return int(value) if math.isfinite(value) else None


def joints_in(found: Rows, file: str) -> tuple[PoseRow, ...]:
    """Return rows of joints alone, without numbers of a pose; none where the header does not name joints."""
    names = (_columns(found) if found.rows else None) or ()
    rows = _with_joints(found.rows, [PoseRow((), row.line, file=file) for row in found.rows], names, set())
    named = bool(rows) and rows[0].joints_deg is not None
    return tuple(_beside(found.rows, rows, [plain(name) for name in names], set())) if named else ()


def _with_joints(given: Sequence[Row], rows: list[PoseRow], names: Sequence[str], used: set[int]) -> list[PoseRow]:
    """Return rows with the readings of joints, where columns are named after them."""
    joints = joint_columns(names)
    if len(joints) < 5 or used & {place for place, _ in joints}:
        return rows
    each = [tuple(one.numbers[place] * factor for place, factor in joints) for one in given]
    return [replace(row, joints_deg=own) for row, own in zip(rows, each, strict=True)]


def _with_words(given: Sequence[Row], rows: list[PoseRow]) -> list[PoseRow]:
    """Return the rows with the first word beside their numbers, one that is no time before one that is."""
    words = [sorted((*row.words, *row.behind), key=lambda word: bool(TIME.search(word))) for row in given]
    return [replace(row, name=some[0]) if some else row for row, some in zip(rows, words, strict=True)]


def _bare(rows: Sequence[Row], file: str) -> PoseList | None:
    """Return poses of rows whose columns nobody names: by how many numbers they have, and what these can be."""
    values = np.array([row.numbers for row in rows])
    while values.shape[1] > 4 and np.isnan(values[:, -1]).all():  # rows that end in a separator
        values = values[:, :-1]
    whole = _whole(values)
    if 4 * (len(values) - len(whole)) > len(values) or not len(whole):
        return None
    width = values.shape[1]
    if width == 4:
        return _of_blocks(rows, values, file) if len(whole) == len(values) else None
    firsts = [first for first in values[:, 0].tolist() if math.isfinite(first)]
    counted = width in (7, 8, 13, 17) and (counts_up(firsts) or rises(firsts))
    for skipped in (0, 1) if counted else (0,):
        conventions = _conventions(whole[:, skipped:])
        if not conventions:
            continue
        first = values[:, 0].tolist()
        made = [
            PoseRow(
                tuple(_as_matrix(values[k, skipped:].tolist())),
                row.line,
                number=_whole_number(first[k]) if skipped and counts_up(firsts) else None,
                time_s=_known(first[k]) if skipped and not counts_up(firsts) else None,
                file=file,
            )
            for k, row in enumerate(rows)
        ]
        return PoseList(tuple(_with_words(rows, made)), conventions, open_angles=True)
    return None


def _as_matrix(numbers: Sequence[float]) -> Sequence[float]:
    return (*numbers, 0.0, 0.0, 0.0, 1.0) if len(numbers) == 12 else numbers


def _of_blocks(rows: Sequence[Row], values: np.ndarray, file: str) -> PoseList | None:
    """Return poses of matrices written in four lines each, or in three without the last."""
    for lines in (4, 3):
        blocks = values[: len(values) // lines * lines].reshape(-1, lines * 4)
        if len(values) % lines or (lines == 4 and np.abs(blocks[:, 12:] - [0, 0, 0, 1]).max() > _UNIT):
            continue
        if not _conventions(blocks):
            continue
        made = [
            PoseRow(tuple(_as_matrix(block.tolist())), rows[k * lines].line, file=file)
            for k, block in enumerate(blocks)
        ]
        return PoseList(tuple(made), ("matrix",))
    return None


def _conventions(values: np.ndarray) -> tuple[str, ...]:
    """Return the conventions in which rows of numbers (N, K) can be poses; none where they can be none."""
    width = values.shape[1]
    if width in (12, 16):
        turned = values[:, :12].reshape(-1, 3, 4)[:, :, :3]
        whole = width == 12 or np.abs(values[:, 12:] - [0, 0, 0, 1]).max() < _UNIT
        right = np.abs(np.einsum("nij,nkj->nik", turned, turned) - np.eye(3)).max() < _UNIT
        by_columns = width == 16 and np.abs(values[:, [3, 7, 11]]).max() == 0
        return ("matrix",) if (whole and right) or by_columns else ()
    positions = values[:, :3]
    if width not in (6, 7) or np.abs(positions).max() > _FARTHEST:
        return ()
    if width == 7:
        if np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1).max() > _UNIT:
            return ()
        first = _of_unit(["quaternion-xyzw", "ros"], "", positions.tolist())
        return (first[0], "quaternion-wxyz")
    if np.abs(values[:, 3:]).max() > _MOST_TURN_DEG or _like_a_cloud(values):
        return ()
    sixes = [convention.name for convention in CONVENTIONS.values() if convention.count == 6]
    return tuple(_of_unit(sixes, "", positions.tolist()))


def _like_a_cloud(values: np.ndarray) -> bool:
    """Return whether the numbers beside a position are a normal or a colour, again and again."""
    beside = values[:, 3:]
    if len(values) < 3:
        return False
    normals = np.abs(np.linalg.norm(beside, axis=1) - 1).max() < _UNIT
    colours = bool((beside == beside.astype(int)).all() and beside.min() >= 0 and beside.max() <= 255)
    return bool(len(values) > 400 and (normals or colours)) or bool(normals and len(values) > 20)
