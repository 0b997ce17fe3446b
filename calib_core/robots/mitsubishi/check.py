"""Mitsubishi: moves from pose to pose as a program."""

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Moves, check_export
from calib_core.exports.writing import listed


def _program(moves: Moves, settings: CheckSettings) -> list[str]:
    lines = [f"' {line}" for line in moves.comments]
    lines.append("Tool P_NTool" if moves.tool is None else "' the tool is the active one: enter it first")
    lines.append("' the flags (7,0) of the positions: those of a position that is taught beside the sphere")
    lines.append(f"Spd {settings.speed_mm_s:g}")
    positions: list[str] = []
    for number, stop in enumerate(moves.stops, start=1):
        names = (f"PA{number}", f"PS{number}")
        positions += [f"{name}=({listed(pose, 6, 8)})(7,0)" for name, pose in stop.named(*names)]
        lines += [
            f"' {stop.title}: is the way to the approach free?",
            "Hlt",
            f"Mvs {names[0]}",
            "Hlt",
            f"Mvs {names[1]}",
            f"' {moves.to_do} now",
            "Hlt",
            f"Mvs {names[0]}",
        ]
    return [*lines, "End", *positions]


CHECK = check_export("mitsubishi", "Mitsubishi", ".prg", "mitsubishi", CheckSettings, _program)
