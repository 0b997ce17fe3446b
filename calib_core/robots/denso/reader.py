"""Denso: what each line of a program says."""

from calib_core.robots.controller_file import Found
from calib_core.robots.statements import VALUES, Rule, find_by_rules

_RULES = (
    Rule("tool", rf"""^[ \t]*Tool\s+(?P<number>\d+)\s*,\s*P?\s*\({VALUES}\)"""),
    Rule("frame", rf"""^[ \t]*Work\s+(?P<number>\d+)\s*,\s*P?\s*\({VALUES}\)"""),
    Rule("use-tool", r"""^[ \t]*ChangeTool\s+(?P<tool>\d+)\s*$"""),
    Rule("use-frame", r"""^[ \t]*ChangeWork\s+(?P<frame>\d+)\s*$"""),
    Rule("joints", rf"""^[ \t]*(?P<name>J\[\s*\d+\s*\])\s*=\s*J?\s*\({VALUES}\)\s*$"""),
    Rule("pose", rf"""^[ \t]*(?P<name>P\[\s*\d+\s*\])\s*=\s*P?\s*\({VALUES}\)\s*$"""),
    Rule("pose", rf"""^[ \t]*Move\b.*?(?<![\w\]])P\s*\({VALUES}\)"""),
    Rule("move", r"""^[ \t]*Move\s+[PL]\s*,.*?(?P<name>[PJ]\[\s*\d+\s*\])\s*(?:,|$)"""),
)
_HEADS = (
    r"""^[ \t]*(?:Tool\s+\d|Work\s+\d|ChangeTool|ChangeWork|[PJ]\[\s*\d+\s*\]\s*=|Approach\b|Depart\b|Draw\b)"""
)


def find(data: bytes, name: str) -> Found:
    """Return what stands in a program."""
    return find_by_rules(data, name, "yaskawa", _RULES, "'", _HEADS)
