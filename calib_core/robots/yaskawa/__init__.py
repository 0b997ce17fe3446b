"""Yaskawa Motoman: jobs and condition files."""

import re
from typing import TYPE_CHECKING

from calib_core.poses.convention import POSE_FORMATS, XYZ_FIXED, Convention
from calib_core.robots.brand import Brand

if TYPE_CHECKING:
    from calib_core.robots.controller_file import Reference

CONVENTION = Convention(
    "yaskawa",
    f"Yaskawa Motoman: {XYZ_FIXED}",
    "x y z Rx Ry Rz",
    "R = Rz(Rz) · Ry(Ry) · Rx(Rx)",
    "mm, degrees",
    "Yaskawa, Motoman",
    POSE_FORMATS + " (Yaskawa)",
    "ZYX",
    "reverse",
)


class Yaskawa(Brand):
    """Yaskawa Motoman."""

    name = "yaskawa"
    title = "Yaskawa Motoman"
    proof = "real files"
    conventions = (CONVENTION,)
    rank = 8
    endings = (".jbi", ".jbr", ".cnd")
    flange = frozenset({"0"})
    base = frozenset({"base", "robot"})
    definitions = "TOOL.CND, UFRAME.CND"
    points = "the job with its //POS section"

    def doubt(self, what: str, number: "Reference") -> str:
        """Return that tool 0 need not be the flange here."""
        return "Tool 0 is not always the flange on a Yaskawa: give TOOL.CND as well." if what == "tool" else ""

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is a job or a condition file."""
        return re.search(r"^(?:/JOB\b|//TOOL\b|//UFRAME\b|///POSTYPE\b)", text, re.MULTILINE) is not None


BRAND = Yaskawa()
