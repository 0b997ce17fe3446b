"""Mitsubishi: what each line of a program says."""

from calib_core.robots.controller_file import Found
from calib_core.robots.statements import VALUES, Rule, find_by_rules

_ONE = r"[-+.\d eE]*"
_NAMED = r"^[ \t]*(?:\d+\s+)?(?P<name>P\w*(?:\(\d+\))?)\s*=\s*"
_ZERO = r"\s*[-+]?0(?:\.0*)?\s*"
_FLAGS = r"(?:\)(?:\(\d+,\d+\))?)?"
_RULES = (
    Rule("tool", rf"""^[ \t]*(?:\d+\s+)?Tool\s*\({VALUES}\)"""),
    Rule("use-frame", rf"""^[ \t]*(?:\d+\s+)?Base\s*\(?\s*(?P<frame>0)(?:\.0*)?(?:,{_ZERO})*{_FLAGS}\s*$"""),
    Rule("use-frame", r"""^[ \t]*(?:\d+\s+)?(?P<frame>Base\b.*)$"""),  # which way round it is, is not settled
    Rule("joints", rf"""^[ \t]*(?:\d+\s+)?(?P<name>J\w*(?:\(\d+\))?)\s*=\s*\({VALUES}\)"""),
    Rule("pose", rf"""{_NAMED}\({VALUES}\)\s*\([^()]*\)\s*$"""),
    # Without its flags, more than six numbers may be numbers and flags whose brackets are lost.
    Rule("pose", rf"""{_NAMED}\((?P<values>{_ONE}(?:,{_ONE}){{5}})\)\s*$"""),
    Rule("move", r"""^[ \t]*(?:\d+\s+)?(?:Mov|Mvs|Mva)\s+(?P<name>[PJ]\w*(?:\(\d+\))?)\s*(?:,|$)"""),
)
_HEADS = r"""^[ \t]*(?:\d+\s+)?(?:Tool\b|Base\b|[PJ]\w*(?:\(\d+\))?\s*=)"""


def find(data: bytes, name: str) -> Found:
    """Return what stands in a program."""
    return find_by_rules(data, name, "mitsubishi", _RULES, "'", _HEADS)
