"""Nachi: what each line of a program says."""

from calib_core.robots.controller_file import Found
from calib_core.robots.statements import VALUES, Rule, find_by_rules

_RULES = (
    Rule("pose", rf"""^[ \t]*MOVEX\b.*?,\s*M1X\s*,\s*[PLC]\s*,\s*\({VALUES}\)(?:.*?\bH\s*=\s*(?P<tool>\d+))?"""),
    Rule("joints", rf"""^[ \t]*MOVEX\b.*?,\s*M1J\s*,\s*[PLC]\s*,\s*\({VALUES}\)"""),
)
_HEADS = r"""^[ \t]*MOVEX\b"""


def find(data: bytes, name: str) -> Found:
    """Return what stands in a program."""
    return find_by_rules(data, name, "nachi", _RULES, "'", _HEADS)
