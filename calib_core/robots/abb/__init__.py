"""ABB: RAPID modules and backups."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.convention import QUATERNION, Convention

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

CONVENTION = Convention(
    "abb",
    "ABB robtarget: trans and rot, scalar first",
    "x y z q1 q2 q3 q4",
    QUATERNION + " with w = q1, x = q2, y = q3, z = q4",
    "mm",
    "ABB",
    "ABB RAPID Reference Manual, data type orient, examples 1 and 2",
    "quaternion",
    "wxyz",
)


class Abb(Brand):
    """ABB."""

    name = "abb"
    title = "ABB"
    conventions = (CONVENTION,)
    rank = 2
    endings = (".mod", ".modx", ".sys", ".sysx", ".prg", ".prgx", ".txt")
    flange = frozenset({"tool0"})
    base = frozenset({"wobj0"})
    definitions = "the module with its tooldata and wobjdata, such as USER.SYS"
    points = "the module that declares it"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds RAPID declarations."""
        return (
            re.search(r"\b(?:CONST|PERS|VAR)\s+(?:robtarget|jointtarget|tooldata|wobjdata)\b", text, re.I)
            is not None
        )

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame data that it writes."""
        from calib_core.robots.abb.check import CHECK
        from calib_core.robots.abb.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return robtargets, jointtargets, tools and work objects of a module."""
        from calib_core.robots.abb.reader import find

        return find(data, name)


BRAND = Abb()
