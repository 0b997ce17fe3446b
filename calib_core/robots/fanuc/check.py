"""FANUC: moves from pose to pose as a program."""

from itertools import chain

from pydantic import Field

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
from calib_core.exports.writing import fixed, remarks

_END = 99
"""The label where the program ends that finds another tool."""


class _Check(NumberedCheck):
    """Which tool of the controller is checked, and the position register that it is read into."""

    tool: int = Field(default=1, ge=1, le=99)  # 0 is the flange itself, and in no UTOOL
    position_register: int = Field(default=100, ge=1, le=9999)


def tool_check(tool: int, register: int, answer: list[float]) -> list[str]:
    """Return the lines that go to the end where the controller's tool is not the answer."""
    wrong = chain.from_iterable(
        _wrong(f"PR[{register},{axis}]", value, 0.05 if axis <= 3 else 0.03, is_angle=axis > 3)
        for axis, value in enumerate(answer, start=1)
    )
    return [f"  PR[{register}]=UTOOL[{tool}]", *(f"  IF ({one}),JMP LBL[{_END}]" for one in wrong)]


def _wrong(name: str, value: float, by: float, *, is_angle: bool) -> list[str]:
    """Return the conditions under which a number is another; angles are from -180 to 180 degrees."""
    low, high = value - by, value + by
    if is_angle and high > 180.0:
        return [f"{name}<{fixed(low, 3)} AND {name}>{fixed(high - 360.0, 3)}"]
    if is_angle and low < -180.0:
        return [f"{name}>{fixed(high, 3)} AND {name}<{fixed(low + 360.0, 3)}"]
    return [f"{name}<{fixed(low, 3)}", f"{name}>{fixed(high, 3)}"]


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


def _program(moves: Moves, settings: _Check) -> list[str]:
    tool = 0 if moves.tool is None else settings.tool
    steps = [f"  !{piece}" for line in moves.comments for piece in remarks(line)]
    if moves.tool is not None:
        said = f"PR[{settings.position_register}] is overwritten with the tool: its numbers are held against these"
        steps += [f"  !{piece}" for piece in remarks(said)]
        steps += tool_check(tool, settings.position_register, moves.tool)
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
    if moves.tool is not None:
        told = [f"  !{piece}" for piece in remarks(f"UTOOL {tool} is not the calibrated one: enter it first")]
        steps += ["  END", f"  LBL[{_END}]", *told, f"  MESSAGE[WRONG UTOOL {tool}]", "  ABORT"]
    numbered = [f"{i:4d}:{step} ;" for i, step in enumerate(steps, start=1)]
    head = [
        f"/PROG  SCAN{moves.name[:4].upper()}",
        "/ATTR",
        f'COMMENT\t\t= "{moves.name} moves";',
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "/MN",
    ]
    return [*head, *numbered, "/POS", *positions, "/END"]


CHECK = check_export("fanuc", "FANUC", ".ls", "fanuc", _Check, _program)
