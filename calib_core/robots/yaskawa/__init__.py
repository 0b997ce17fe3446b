"""Yaskawa Motoman: jobs and condition files."""

import re
from typing import TYPE_CHECKING

from calib_core.messages import message
from calib_core.poses.convention import POSE_FORMATS, XYZ_FIXED, Convention
from calib_core.robots.brand import Brand

if TYPE_CHECKING:
    from collections.abc import Sequence

    from calib_core.robots.controller_file import Found, Reference

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
    endings = (".jbi", ".jbr", ".cnd", ".prm")
    flange = frozenset({"0"})
    base = frozenset({"base", "robot"})
    definitions = "TOOL.CND, UFRAME.CND"
    points = message("the job with its //POS section")

    def doubt(self, what: str, number: "Reference") -> str:
        """Return that tool 0 need not be the flange here."""
        return "Tool 0 is not always the flange on a Yaskawa: give TOOL.CND as well." if what == "tool" else ""

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is a job, a condition file or the arm's parameters."""
        return re.search(r"^(?:/JOB\b|//(?:TOOL|UFRAME)\b|///(?:POSTYPE|RC\dG)\b)", text, re.MULTILINE) is not None

    def together(self, found: "Sequence[Found]") -> "Sequence[Found]":
        """Return what files hold, positions in pulses as joints where one of them tells what makes a degree."""
        from calib_core.robots.yaskawa.pulses import with_joints

        return with_joints(found)


BRAND = Yaskawa()
