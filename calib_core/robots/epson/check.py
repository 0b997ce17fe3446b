"""Epson: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_programs import NumberedCheck, Sides, check_export
from calib_core.exports.writing import listed


def _program(comments: Sequence[str], sides: Sides, settings: NumberedCheck) -> list[str]:
    lines = ["Function ScancellCheck", *(f"  ' {line}" for line in comments)]
    lines += [
        "  Power Low",
        f"  Tool {settings.tool}",
        f"  SpeedS {settings.speed_mm_s:g}",
        "  AccelS 100",
        "  SpeedR 5",
    ]
    for number, (approach, target) in enumerate(sides, start=1):
        out, on = (f"  Move XY({listed(pose, 6, 8)})" for pose in (approach, target))
        lines += [
            f'  Print "Side {number}: is the way to the approach free?"',
            "  Pause",
            out,
            f'  Print "Side {number}: go to the sphere?"',
            "  Pause",
            on,
            f'  Print "Side {number}: read the scanner, then go back"',
            "  Pause",
            out,
        ]
    return [*lines, "Fend"]


CHECK = check_export("epson", "Epson", ".prg", "nachi", NumberedCheck, _program)
