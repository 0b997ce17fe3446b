"""Comau: what each line of a program says."""

from calib_core.robots.controller_file import Found
from calib_core.robots.statements import VALUES, Rule, find_by_rules

_RULES = (
    Rule("tool", rf"""\$TOOL\s*:=\s*POS\s*\({VALUES}(?:,\s*'[^']*')?\s*\)"""),
    Rule("frame", rf"""\$UFRAME\s*:=\s*POS\s*\({VALUES}(?:,\s*'[^']*')?\s*\)"""),
    Rule("pose", rf"""^[ \t]*(?P<name>\w+(?:\[\d+\])?)\s*:=\s*POS\s*\({VALUES}(?:,\s*'[^']*')?\s*\)"""),
    Rule("pose", rf"""\bMOVE\w*\s+(?:LINEAR|JOINT)?\s*TO\s+POS\s*\({VALUES}(?:,\s*'[^']*')?\s*\)"""),
    Rule("joints", rf"""\bMOVE\w*\s+(?:LINEAR|JOINT)?\s*TO\s+\{{{VALUES}\}}"""),
    Rule("move", r"""\bMOVE\w*\s+(?:LINEAR\s+|JOINT\s+)?TO\s+(?P<name>[A-Za-z_]\w*(?:\[\d+\])?)(?=\s|$|,)"""),
)
_HEADS = r"""\$TOOL\s*:=|\$UFRAME\s*:=|\$BASE\s*:=|:=\s*POS\b|\bMOVE\w*\s+(?:LINEAR|JOINT)?\s*TO\s+(?:POS\b|\{)"""


def find(data: bytes, name: str) -> Found:
    """Return what stands in a program."""
    return find_by_rules(data, name, "kawasaki", _RULES, "--", _HEADS)
