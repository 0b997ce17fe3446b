"""Poses in JSON of any shape: lists of numbers, matrices, or objects with named numbers, wherever they lie."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

from calib_core.recognition.number_rows import Row, Rows
from calib_core.recognition.pose_rows import poses_in, poses_of_numbers
from calib_core.recognition.taken import PoseList

_DEEPEST = 8
_MOST_NODES = 200_000
_SPHERES = ("sphere", "ball", "kugel")
_QUATERNION = {"x": "qx", "y": "qy", "z": "qz", "w": "qw"}
_TURNS = ("orientation", "rotation", "quaternion", "quat", "rot")
_PLACES = ("position", "translation", "trans", "pos", "xyz")


def parsed(text: str) -> Any:
    """Return JSON data, None where a text is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def keys_of(data: Any) -> str:
    """Return the first keys of JSON data, for a sentence."""
    if isinstance(data, Mapping):
        names = [str(key)[:30] for key in list(cast("Mapping[str, Any]", data))[:4]]
        return ", ".join(names) + (" …" if len(cast("Mapping[str, Any]", data)) > 4 else "")
    return type(data).__name__


def poses_in_json(data: Any, file: str) -> tuple[PoseList, str] | None:
    """Return the longest list of poses in JSON data and the keys it lies under; None where there is none."""
    found: list[tuple[PoseList, str]] = []
    for path, node in _nodes(data):
        poses = _poses(node, file)
        if poses is not None:
            found.append((poses, path))
    return max(found, key=lambda one: len(one[0].rows), default=None)


def sphere_mm_in(data: Any) -> float | None:
    """Return the diameter of a sphere that settings tell in mm, None where none or several tell one."""
    told: set[float] = set()
    for path, node in _nodes(data):
        if not isinstance(node, Mapping):
            continue
        fields = {str(k).lower(): v for k, v in cast("Mapping[str, Any]", node).items()}
        about = path.lower() + " ".join(f"{k} {v}" for k, v in fields.items() if isinstance(v, str)).lower()
        for key, value in fields.items():
            if not isinstance(value, int | float) or not any(word in about + key for word in _SPHERES):
                continue
            if "diameter" in key or "durchmesser" in key:
                told.add(float(value))
            elif "radius" in key:
                told.add(2.0 * float(value))
    likely = {diameter for diameter in told if 2 <= diameter <= 1000}
    return likely.pop() if len(likely) == 1 else None


def _nodes(data: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield lists and objects with the keys that lead to them, the outer ones first, up to a number of them."""
    waiting: list[tuple[str, Any, int]] = [(path, data, depth)]
    for _ in range(_MOST_NODES):
        if not waiting:
            return
        where, node, deep = waiting.pop(0)
        if not isinstance(node, Mapping | list):
            continue
        yield where, node
        if deep >= _DEEPEST:
            continue
        items = list(cast("Mapping[str, Any]", node).items()) if isinstance(node, Mapping) else []
        waiting += [(f"{where}.{key}".lstrip("."), value, deep + 1) for key, value in items]
        if isinstance(node, list) and not _all_numbers(node):
            waiting += [(where, value, deep + 1) for value in cast("list[Any]", node)[:2000]]


def _poses(node: Any, file: str) -> PoseList | None:
    """Return the poses that a list or an object of equal members is."""
    if isinstance(node, Mapping):
        members = list(cast("Mapping[str, Any]", node).values())
        names = [str(key) for key in cast("Mapping[str, Any]", node)]
    else:
        members = cast("list[Any]", node)
        names = [""] * len(members)
    if not members:
        return None
    rows = [_row(member) for member in members]
    if all(row is not None for row in rows):
        return poses_of_numbers(cast("list[list[float]]", rows), names, file)
    if all(isinstance(member, Mapping) for member in members):
        return _of_objects(cast("list[Mapping[str, Any]]", members), names, file)
    return None


def _row(member: Any) -> list[float] | None:
    """Return the numbers of a list, or of a matrix of 4 × 4 or 3 × 4 numbers, row by row."""
    if not isinstance(member, list):
        return None
    items = cast("list[Any]", member)
    if items and all(isinstance(row, list) and _all_numbers(cast("list[Any]", row), 4) for row in items):
        flat = [float(v) for row in cast("list[list[float]]", items) for v in row]
        return flat if len(flat) in (12, 16) else None
    return [float(v) for v in items] if len(items) in (6, 7, 8, 12, 16, 17) and _all_numbers(items) else None


def _all_numbers(items: Sequence[Any], count: int | None = None) -> bool:
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in items)
    return bool(items) and numbers and count in (None, len(items))


def _of_objects(members: Sequence[Mapping[str, Any]], names: Sequence[str], file: str) -> PoseList | None:
    """Return the poses of objects that name their numbers, or hold them in a list of their own."""
    flat = [_flat(member) for member in members]
    shared = [key for key in flat[0] if all(isinstance(one.get(key), float) for one in flat)]
    own = [[one[key] for key in ("name", "id", "file") if isinstance(one.get(key), str)] for one in flat]
    said = [str(mine[0]) if mine else name for mine, name in zip(own, names, strict=True)]
    rows = tuple(
        Row(k, (name,) if name else (), tuple(float(one[key]) for key in shared), tuple(shared))
        for k, (one, name) in enumerate(zip(flat, said, strict=True), start=1)
    )
    named = poses_in(Rows(rows, (), 0), file) if len(shared) > 5 else None
    if named is not None:
        rows_of = zip(named.rows, said, strict=True)
        return replace(named, rows=tuple(replace(row, name=name) for row, name in rows_of))
    for key in members[0]:
        lists = [_row(member.get(key)) for member in members]
        if all(one is not None for one in lists):
            found = poses_of_numbers(cast("list[list[float]]", lists), said, file)
            if found is not None:
                return found
    return None


def _flat(member: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object's fields by their names in lower case, those of a position and an orientation too."""
    flat: dict[str, Any] = {}
    for key, value in member.items():
        name = str(key).lower()
        if isinstance(value, Mapping):
            inner = {str(k).lower(): v for k, v in cast("Mapping[str, Any]", value).items()}
            if name in ("pose", "transform"):
                flat |= _flat(inner)
            elif name in _TURNS and set(_QUATERNION) <= set(inner):
                flat |= {_QUATERNION[k]: float(inner[k]) for k in _QUATERNION if _all_numbers([inner[k]])}
            elif name in (*_PLACES, *_TURNS):
                flat |= {k: float(v) for k, v in inner.items() if _all_numbers([v])}
        elif isinstance(value, int | float) and not isinstance(value, bool):
            flat[name] = float(value)
        else:
            flat[name] = value
    return flat
