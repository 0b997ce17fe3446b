"""FANUC: moves from pose to pose as a program."""

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
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


def _program(moves: Moves, settings: NumberedCheck) -> list[str]:
    tool = 0 if moves.tool is None else settings.tool
    steps = [f"  !{piece}" for line in moves.comments for piece in remarks(line)]
    steps += ["  UFRAME_NUM=0", f"  UTOOL_NUM={tool}"]
    positions: list[str] = []
    for number, stop in enumerate(moves.stops, start=1):
        at, on = 2 * number - 1, 2 * number
        speed = f"{max(round(settings.speed_mm_s), 1)}mm/sec FINE"
        steps += [
            *(f"  !{piece}" for piece in remarks(f"{stop.title}: is the way free?")),
            "  PAUSE",
            f"L P[{at}] {speed}",
            "  PAUSE",
            f"L P[{on}] {speed}",
        ]
        steps += [f"  !{moves.to_do} now", "  PAUSE", f"L P[{at}] {speed}"]
        positions += [*_position(at, stop.approach, tool), *_position(on, stop.target, tool)]
    numbered = [f"{i:4d}:{step} ;" for i, step in enumerate(steps, start=1)]
    head = [
        f"/PROG  SCAN{moves.name[:4].upper()}",
        "/ATTR",
        f'COMMENT\t\t= "{moves.name} moves";',
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "/MN",
    ]
    return [*head, *numbered, "/POS", *positions, "/END"]


CHECK = check_export("fanuc", "FANUC", ".ls", "fanuc", NumberedCheck, _program)
