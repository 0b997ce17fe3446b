"""ABB: RAPID modules and backups."""

from calib_core.messages import message
from calib_core.poses.convention import Convention
from calib_core.robots.brand import Brand

CONVENTION = Convention(
    "abb",
    "ABB robtarget: trans and rot, scalar first",
    "x y z q1 q2 q3 q4",
    "R = R(q), q = q1 + q2 i + q3 j + q4 k, ‖q‖ = 1",
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
    proof = "real files"
    conventions = (CONVENTION,)
    rank = 2
    endings = (".mod", ".modx", ".sys", ".sysx", ".prg", ".prgx", ".txt")
    marks = r"\b(?:CONST|PERS|VAR)\s+(?:robtarget|jointtarget|tooldata|wobjdata)\b"
    flange = frozenset({"tool0"})
    base = frozenset({"wobj0"})
    definitions = message("the module with its tooldata and wobjdata, such as USER.SYS")
    points = message("the module that declares it")


BRAND = Abb()
