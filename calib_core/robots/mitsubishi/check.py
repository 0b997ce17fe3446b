"""Mitsubishi: moves from pose to pose as a program."""

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Moves, check_export
from calib_core.exports.writing import fixed, listed


def _tool_check(tool: list[float]) -> list[str]:
    """Return the lines that stop for good where the active tool is not the answer, angles there in radians."""
    wrong = [f"Abs(POFF.{axis}) > 0.05" for axis in "XYZ"] + [f"Abs(POFF.{axis}) > 0.0005" for axis in "ABC"]
    return [
        "' the tool is the active one: enter it first; the program goes on with no other",
        "PTOOL = P_NTool",
        *(f"PTOOL.{axis} = {fixed(value, 6)}" for axis, value in zip("XYZ", tool[:3], strict=True)),
        *(f"PTOOL.{axis} = Rad({fixed(value, 8)})" for axis, value in zip("ABC", tool[3:], strict=True)),
        "*CHECK",
        "POFF = P_Tool",
        "POFF = Inv(POFF)",
        "POFF = POFF * PTOOL",
        "MOFF = 0",
        *(f"If {one} Then MOFF = 1" for one in wrong),
        "If MOFF = 1 Then Hlt",
        "If MOFF = 1 Then GoTo *CHECK",
    ]


def _program(moves: Moves, settings: CheckSettings) -> list[str]:
    lines = [f"' {line}" for line in moves.comments]
    lines += ["Tool P_NTool"] if moves.tool is None else _tool_check(moves.tool)
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
