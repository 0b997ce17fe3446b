"""Mitsubishi: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Sides, check_export
from calib_core.exports.writing import listed


def _program(comments: Sequence[str], sides: Sides, settings: CheckSettings) -> list[str]:
    lines = [f"' {line}" for line in comments]
    lines.append("' the tool is the active one: enter it first")
    lines.append("' the flags (7,0) of the positions: those of a position that is taught beside the sphere")
    lines.append(f"Spd {settings.speed_mm_s:g}")
    positions: list[str] = []
    for number, side in enumerate(sides, start=1):
        names = (f"PA{number}", f"PS{number}")
        positions += [f"{name}=({listed(pose, 6, 8)})(7,0)" for name, pose in zip(names, side, strict=True)]
        lines += [
            f"' side {number}: is the way to the approach free?",
            "Hlt",
            f"Mvs {names[0]}",
            "Hlt",
            f"Mvs {names[1]}",
            "' read the scanner now",
            "Hlt",
            f"Mvs {names[0]}",
        ]
    return [*lines, "End", *positions]


CHECK = check_export("mitsubishi", "Mitsubishi", ".prg", "mitsubishi", CheckSettings, _program)
