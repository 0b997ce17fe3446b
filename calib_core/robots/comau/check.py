"""Comau: moves from pose to pose as a program."""

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Moves, check_export
from calib_core.exports.writing import listed


def _program(moves: Moves, settings: CheckSettings) -> list[str]:
    lines = [f"PROGRAM scan{moves.name} PROG_ARM=1", "BEGIN", *(f"  -- {line}" for line in moves.comments)]
    if moves.tool is None:
        lines.append("  $TOOL := POS(0, 0, 0, 0, 0, 0, '')")
    else:
        lines.append("  -- $TOOL is the active one: set it first; poses are in the robot's base")
    lines += ["  $UFRAME := POS(0, 0, 0, 0, 0, 0, '')", "  $SPD_OPT := SPD_LIN"]
    lines.append(f"  $LIN_SPD := {settings.speed_mm_s / 1000:.3f}")
    for stop in moves.stops:
        out, on = (f"  MOVE LINEAR TO POS({listed(pose, 6, 8)}, '')" for pose in (stop.approach, stop.target))
        lines += [
            f"  -- {stop.title}: is the way to the approach free?",
            "  PAUSE",
            out,
            "  PAUSE",
            on,
            f"  -- {moves.to_do} now",
            "  PAUSE",
            out,
        ]
    return [*lines, f"END scan{moves.name}"]


CHECK = check_export("comau", "Comau", ".pdl", "kawasaki", CheckSettings, _program)
