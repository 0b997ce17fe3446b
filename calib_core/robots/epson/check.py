"""Epson: moves from pose to pose as a program."""

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
from calib_core.exports.writing import listed


def _program(moves: Moves, settings: NumberedCheck) -> list[str]:
    lines = [f"Function Scancell{moves.name.title()}", *(f"  ' {line}" for line in moves.comments)]
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
