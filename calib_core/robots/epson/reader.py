"""Epson: what each line of a program says."""

from calib_core.robots.controller_file import Found
from calib_core.robots.statements import VALUES, Rule, find_by_rules

_ARM = r"(?:/[RLABFNJ]\w*\s*)*"  # how the arm stands
_RULES = (
    Rule("tool", rf"""^[ \t]*TLSet\s+(?P<number>\d+)\s*,\s*XY\s*\({VALUES}\)"""),
    Rule("frame", rf"""^[ \t]*Local\s+(?P<number>\d+)\s*,\s*XY\s*\({VALUES}\)"""),
    Rule("use-tool", r"""^[ \t]*Tool\s+(?P<tool>\d+)\s*$"""),
    Rule(
        "pose",
        rf"""^[ \t]*(?P<name>P\d+|P\(\d+\))\s*=\s*XY\s*\({VALUES}\)\s*{_ARM}(?:/(?P<frame>\d+)\s*)?{_ARM}$""",
    ),
    Rule("pose", rf"""^[ \t]*(?:Go|Move|Jump3?)\s+XY\s*\({VALUES}\)"""),
    Rule("move", r"""^[ \t]*(?:Go|Move|Jump3?|Arc3?)\s+(?P<name>P\d+|P\(\d+\))(?=\s|$|,)"""),
)
# TGo and its like move from where the arm is: no poses.
_HEADS = r"""^[ \t]*(?:TLSet\b|Local\s+\d|P\d+\s*=|P\(\d+\)\s*=|[TB](?:Go|Move)\b)"""


def find(data: bytes, name: str) -> Found:
    """Return what stands in a program."""
    return find_by_rules(data, name, "nachi", _RULES, "'", _HEADS)
