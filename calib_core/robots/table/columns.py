"""Which column of a table is what: by the user's word, or by a header that leaves no choice."""

import math
import re
from collections import Counter
from collections.abc import Sequence

from calib_core.poses.conventions import CONVENTIONS

OTHERS = ("name", "tool", "frame", "table", "-", *(f"j{k}" for k in range(1, 8)))
_UNIT = re.compile(
    r"(?:[\s_]*[\[(]?(mm|deg|rad|°|m)|[\s_]*[\s_\[(](in|inch|inches|cm|um|µm|ft))[\])]?$", re.IGNORECASE
)
_NAMES = {
    "name": "name", "id": "name", "file": "name", "capture": "name", "tool": "tool", "frame": "frame",
    "table": "table", "table_deg": "table", "turntable": "table", "parent": "parent", "child": "child",
}  # fmt: skip
_JOINT = re.compile(r"(j|a|q|joint[ _]?|axis[ _]?)[1-9]")
_SAME = {"tx": "x", "ty": "y", "tz": "z", "px": "x", "py": "y", "pz": "z"}
_JOINTS = (5, 6, 7)  # fewer may be anything else
_CERTAIN = ("qx", "qy", "qz", "qw")


def plain(head: str) -> str:
    """Return a column's name in lower case, without its unit."""
    return _UNIT.sub("", head.strip().strip('"').lower())


def unit_of(head: str) -> str:
    """Return the unit in a column's name, or nothing."""
    found = _UNIT.search(head.strip().strip('"'))
    return (found[1] or found[2]).lower() if found and found[0] != head.strip() else ""


def joint_columns(heads: Sequence[str]) -> list[tuple[int, float]]:
    """Return the column of each joint in order, as controllers name them, with the factor to deg (or mm)."""
    names = [plain(head) for head in heads]
    found: list[int] = []
    for stem in dict.fromkeys(one[1] for name in names if (one := _JOINT.fullmatch(name))):
        count = next(n for n in range(1, 11) if names.count(f"{stem}{n}") != 1)
        found = max(found, [names.index(f"{stem}{n}") for n in range(1, count)], key=len)
    return [(place, math.degrees(1) if unit_of(heads[place]) == "rad" else 1.0) for place in found]


def roles_of(heads: Sequence[str], convention: str | None = None) -> list[str]:
    """Return what each column is, by its name; none where the header does not name a whole pose.

    Without a convention only quaternions are certain: `A B C` and `rx ry rz` differ from controller to controller.
    """
    names = [_SAME.get(name, name) for name in map(plain, heads)]
    times = Counter(names)
    names = [name if times[name] == 1 else "-" for name in names]
    wanted = (
        [n.lower() for n in CONVENTIONS[convention].numbers.split()] if convention else ["x", "y", "z", *_CERTAIN]
    )
    if not set(wanted) <= set(names):
        return []
    joints = {place: f"j{n}" for n, (place, factor) in enumerate(joint_columns(heads), start=1) if factor == 1}
    others = {**dict.fromkeys(range(len(names)), "-"), **(joints if len(joints) in _JOINTS else {})}
    return [name if name in wanted else _NAMES.get(name, others[place]) for place, name in enumerate(names)]
