"""Mitsubishi: programs, line by line."""

from calib_core.messages import message
from calib_core.poses.convention import POSE_FORMATS, XYZ_FIXED, Convention
from calib_core.robots.brand import Brand

CONVENTION = Convention(
    "mitsubishi",
    f"Mitsubishi A B C: {XYZ_FIXED}",
    "x y z A B C",
    "R = Rz(C) · Ry(B) · Rx(A)",
    "mm, degrees",
    "Mitsubishi",
    POSE_FORMATS + " (Mitsubishi XYZ-ABC)",
    "ZYX",
    "reverse",
)


class Mitsubishi(Brand):
    """Mitsubishi."""

    name = "mitsubishi"
    title = "Mitsubishi"
    conventions = (CONVENTION,)
    rank = 8
    endings = (".prg", ".mb4", ".mb5", ".mb6", ".pos", ".txt")
    marks = (
        r"^[ \t]*(?:\d+\s+)?(?:Def\s+Pos\b|Tool\s*\([-+.\d]|P\w+(?:\(\d+\))?\s*=\s*\([-+.\d eE,]+\)\s*\(\d+\s*,)"
    )
    base = frozenset({"0", "base p_nbase"})
    definitions = message("the program with its Tool and Base lines")
    frames_settled = False


BRAND = Mitsubishi()
