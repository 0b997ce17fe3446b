"""Comau: moves from pose to pose as a program."""

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Moves, check_export
from calib_core.exports.writing import listed

_OFF = [
    "VAR off : POSITION",
    "    off_x, off_y, off_z, off_a, off_b, off_c : REAL",
    "    off_cnfg : STRING[80]",
]


def _tool_check(tool: list[float]) -> list[str]:
    """Return the lines between which the moves stand: nothing moves where the active tool is not the answer."""
    return [
        "  -- $TOOL is the active one: set it first; poses are in the robot's base",
        f"  off := POS_INV($TOOL) : POS({listed(tool, 6, 8)}, '')",
        "  POS_XTRT(off, off_x, off_y, off_z, off_a, off_b, off_c, off_cnfg)",
        "  IF (SQRT(off_x * off_x + off_y * off_y + off_z * off_z) > 0.05) OR (ABS(off_b) > 0.03)"
        " OR ((ABS(off_a + off_c) > 0.03) AND (ABS(off_a + off_c) < 359.97)) THEN",
        "    WRITE LUN_CRT('The active tool is not the calibrated one: set it first', NL)",
        "  ELSE",
    ]


def _program(moves: Moves, settings: CheckSettings) -> list[str]:
    begin = ["BEGIN", *(f"  -- {line}" for line in moves.comments)]
    lines = [f"PROGRAM scan{moves.name} PROG_ARM=1", *([] if moves.tool is None else _OFF), *begin]
    lines += ["  $TOOL := POS(0, 0, 0, 0, 0, 0, '')"] if moves.tool is None else _tool_check(moves.tool)
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
    return [*lines, *([] if moves.tool is None else ["  ENDIF"]), f"END scan{moves.name}"]


CHECK = check_export("comau", "Comau", ".pdl", "kawasaki", CheckSettings, _program)
