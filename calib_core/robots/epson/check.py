"""Epson: moves from pose to pose as a program."""

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
from calib_core.exports.writing import fixed, listed


def _tool_check(number: int, tool: list[float]) -> list[str]:
    """Return the lines that end the program where the controller's tool is not the answer."""
    names = ("CX", "CY", "CZ", "CU", "CV", "CW")
    offs = [f"Abs({name}(TLSet({number})) - ({fixed(value, 6)}))" for name, value in zip(names, tool, strict=True)]
    wrong = [*(f"{off} > 0.05" for off in offs[:3]), *(f"({off} > 0.03 And {off} < 359.97)" for off in offs[3:])]
    ends = [f'    Print "Tool {number} is not the calibrated one: enter it first"', "    Exit Function", "  EndIf"]
    return [line for one in wrong for line in (f"  If {one} Then", *ends)]


def _program(moves: Moves, settings: NumberedCheck) -> list[str]:
    lines = [f"Function Scancell{moves.name.title()}", *(f"  ' {line}" for line in moves.comments)]
    lines += [] if moves.tool is None else _tool_check(settings.tool, moves.tool)
    lines += [
        "  Power Low",
        f"  Tool {0 if moves.tool is None else settings.tool}",
        f"  SpeedS {settings.speed_mm_s:g}",
        "  AccelS 100",
        "  SpeedR 5",
    ]
    for stop in moves.stops:
        out, on = (f"  Move XY({listed(pose, 6, 8)})" for pose in (stop.approach, stop.target))
        lines += [
            f'  Print "{stop.title}: is the way to the approach free?"',
            "  Pause",
            out,
            f'  Print "{stop.title}: go to {moves.goal}?"',
            "  Pause",
            on,
            f'  Print "{stop.title}: {moves.to_do}, then go back"',
            "  Pause",
            out,
        ]
    return [*lines, "Fend"]


CHECK = check_export("epson", "Epson", ".prg", "nachi", NumberedCheck, _program)
