"""Kawasaki AS: moves from pose to pose as a program with its positions."""

from calib_core.exports.check_programs import Moves, NamedCheck, check_export
from calib_core.exports.writing import DottedName, fixed, listed


class _Check(NamedCheck):
    """Which tool of the controller is checked; its name may have dots."""

    tool: DottedName = "tScanner"


def _tool_check(name: str, tool: list[float]) -> list[str]:
    """Return the lines that end the program where the controller's tool is not the answer."""
    return [
        f"  DECOMPOSE sc_off[0] = -{name}+TRANS({listed(tool, 6, 6)})",
        "  sc_mm = SQRT(sc_off[0]*sc_off[0]+sc_off[1]*sc_off[1]+sc_off[2]*sc_off[2])",
        "  sc_turn = ABS(sc_off[3]+sc_off[5])",
        "  IF sc_mm > 0.05 OR ABS(sc_off[4]) > 0.03 OR (sc_turn > 0.03 AND sc_turn < 359.97) THEN",
        f'    PRINT "{name} is not the calibrated tool: enter it first"',
        "    HALT",
        "  END",
    ]


def _program(moves: Moves, settings: NamedCheck) -> list[str]:
    lines = [f".PROGRAM scan{moves.name}()", *(f"  ; {line}" for line in moves.comments)]
    lines += [] if moves.tool is None else _tool_check(settings.tool, moves.tool)
    lines += [
        f"  TOOL {'NULL' if moves.tool is None else settings.tool}",
        "  BASE NULL",
        f"  SPEED {settings.speed_mm_s:g} MM/S ALWAYS",
        "  ACCURACY 1 ALWAYS",
    ]
    positions: list[str] = []
    for number, stop in enumerate(moves.stops, start=1):
        names = (f"sc_out{number}", f"sc_on{number}")
        positions += [f"{name} {' '.join(fixed(v, 6) for v in pose)}" for name, pose in stop.named(*names)]
        lines += [
            f"  ; {stop.title}: is the way to the approach free?",
            "  PAUSE",
            f"  LMOVE {names[0]}",
            "  BREAK",
            "  PAUSE",
            f"  LMOVE {names[1]}",
            "  BREAK",
            f"  ; {moves.to_do} now",
            "  PAUSE",
            f"  LMOVE {names[0]}",
        ]
    return [*lines, ".END", ".TRANS", *positions, ".END"]


CHECK = check_export("kawasaki", "Kawasaki AS", ".as", "kawasaki", _Check, _program)
