"""Doosan: what each line of a program says."""

from calib_core.robots.controller_file import Found
from calib_core.robots.statements import VALUES, Rule, find_by_rules

_RULES = (
    Rule("pose", rf"""(?:(?P<name>\w+)\s*=\s*)?\bposx\s*\(\s*{VALUES}\)"""),
    Rule("joints", rf"""(?:(?P<name>\w+)\s*=\s*)?\bposj\s*\(\s*{VALUES}\)"""),
    Rule("move", r"""\bmove[jlc]x?\s*\(\s*(?P<name>[A-Za-z_]\w*)\s*[,)]"""),
)
_HEADS = r"""\bpos[xj]\s*\("""


def find(data: bytes, name: str) -> Found:
    """Return what stands in a program."""
    return find_by_rules(data, name, "kawasaki", _RULES, "#", _HEADS)
