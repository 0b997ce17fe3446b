"""FANUC: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_programs import NumberedCheck, Sides, check_export
from calib_core.exports.writing import fixed, remarks


def _position(index: int, pose: list[float], tool: int) -> list[str]:
    x, y, z, w, p, r = (fixed(v, 3) for v in pose)
    return [
        f"P[{index}]{{",
        "   GP1:",
        f"\tUF : 0, UT : {tool},\t\tCONFIG : 'N U T, 0, 0, 0',",
        f"\tX = {x}  mm,\tY = {y}  mm,\tZ = {z}  mm,",
        f"\tW = {w} deg,\tP = {p} deg,\tR = {r} deg",
        "};",
    ]


def _program(comments: Sequence[str], sides: Sides, settings: NumberedCheck) -> list[str]:
    steps = [f"  !{piece}" for line in comments for piece in remarks(line)]
    steps += ["  UFRAME_NUM=0", f"  UTOOL_NUM={settings.tool}"]
    positions: list[str] = []
    for number, (approach, target) in enumerate(sides, start=1):
        at, on = 2 * number - 1, 2 * number
        speed = f"{max(round(settings.speed_mm_s), 1)}mm/sec FINE"
        steps += [
            f"  !side {number}: is the way free?",
            "  PAUSE",
            f"L P[{at}] {speed}",
            "  PAUSE",
            f"L P[{on}] {speed}",
        ]
        steps += ["  !read the scanner now", "  PAUSE", f"L P[{at}] {speed}"]
        positions += [*_position(at, approach, settings.tool), *_position(on, target, settings.tool)]
    numbered = [f"{i:4d}:{step} ;" for i, step in enumerate(steps, start=1)]
    head = ["/PROG  SCANCHK", "/ATTR", 'COMMENT\t\t= "check move";', "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    return [*head, *numbered, "/POS", *positions, "/END"]


CHECK = check_export("fanuc", "FANUC", ".ls", "fanuc", NumberedCheck, _program)
