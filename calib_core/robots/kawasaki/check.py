"""Kawasaki AS: the check move as a program with its positions."""

from collections.abc import Sequence

from calib_core.exports.check_programs import NamedCheck, Sides, check_export
from calib_core.exports.writing import fixed


def _program(comments: Sequence[str], sides: Sides, settings: NamedCheck) -> list[str]:
    lines = [".PROGRAM scancheck()", *(f"  ; {line}" for line in comments)]
    lines += [
        f"  TOOL {settings.tool}",
        "  BASE NULL",
        f"  SPEED {settings.speed_mm_s:g} MM/S ALWAYS",
        "  ACCURACY 1 ALWAYS",
    ]
    positions: list[str] = []
    for number, side in enumerate(sides, start=1):
        names = (f"sc_out{number}", f"sc_on{number}")
        positions += [
            f"{name} {' '.join(fixed(v, 6) for v in pose)}" for name, pose in zip(names, side, strict=True)
        ]
        lines += [
            f"  ; side {number}: is the way to the approach free?",
            "  PAUSE",
            f"  LMOVE {names[0]}",
            "  BREAK",
            "  PAUSE",
            f"  LMOVE {names[1]}",
            "  BREAK",
            "  ; read the scanner now",
            "  PAUSE",
            f"  LMOVE {names[0]}",
        ]
    return [*lines, ".END", ".TRANS", *positions, ".END"]


CHECK = check_export("kawasaki", "Kawasaki AS", ".as", "kawasaki", NamedCheck, _program)
