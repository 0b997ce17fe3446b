"""Comau: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Sides, check_export
from calib_core.exports.writing import listed


def _program(comments: Sequence[str], sides: Sides, settings: CheckSettings) -> list[str]:
    lines = ["PROGRAM scancheck PROG_ARM=1", "BEGIN", *(f"  -- {line}" for line in comments)]
    lines.append("  -- $TOOL is the active one: set it first; poses are in the robot's base")
    lines += ["  $UFRAME := POS(0, 0, 0, 0, 0, 0, '')", "  $SPD_OPT := SPD_LIN"]
    lines.append(f"  $LIN_SPD := {settings.speed_mm_s / 1000:.3f}")
    for number, (approach, target) in enumerate(sides, start=1):
        out, on = (f"  MOVE LINEAR TO POS({listed(pose, 6, 8)}, '')" for pose in (approach, target))
        lines += [
            f"  -- side {number}: is the way to the approach free?",
            "  PAUSE",
            out,
            "  PAUSE",
            on,
            "  -- read the scanner now",
            "  PAUSE",
            out,
        ]
    return [*lines, "END scancheck"]


CHECK = check_export("comau", "Comau", ".pdl", "kawasaki", CheckSettings, _program)
