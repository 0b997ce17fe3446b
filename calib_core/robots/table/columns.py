"""Which column of a table is what: by the user's word, or by a header that leaves no choice."""

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
_SAME = {"tx": "x", "ty": "y", "tz": "z", "px": "x", "py": "y", "pz": "z"}
_CERTAIN = ("qx", "qy", "qz", "qw")


def plain(head: str) -> str:
    """Return a column's name in lower case, without its unit."""
    return _UNIT.sub("", head.strip().strip('"').lower())


def unit_of(head: str) -> str:
    """Return the unit in a column's name, or nothing."""
    found = _UNIT.search(head.strip().strip('"'))
    return (found[1] or found[2]).lower() if found and found[0] != head.strip() else ""


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
    return [name if name in wanted else _NAMES.get(name, "-") for name in names]
