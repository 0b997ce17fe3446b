"""Denso: moves from pose to pose as a program; its controllers take speeds in percent."""

from pydantic import Field

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
from calib_core.exports.writing import fixed, listed


class _Check(NumberedCheck):
    """Which tool of the controller is checked, and at how many percent of the arm's speed."""

    speed_percent: int = Field(default=2, ge=1, le=10)


def _tool_check(number: int, tool: list[float]) -> list[str]:
    """Return the lines that end the program where the controller's tool is not the answer."""
    names = ("PosX", "PosY", "PosZ", "PosRx", "PosRy", "PosRz")
    offs = [
        f"Abs({name}(ToolPos({number})) - ({fixed(value, 6)}))" for name, value in zip(names, tool, strict=True)
    ]
    wrong = [*(f"{off} > 0.05" for off in offs[:3]), *(f"({off} > 0.03 And {off} < 359.97)" for off in offs[3:])]
    ends = [f'Hold "Tool {number} is not the calibrated one: enter it first"', "GiveArm", "Exit Sub", "End If"]
    return [line for one in wrong for line in (f"If {one} Then", *ends)]


def _program(moves: Moves, settings: _Check) -> list[str]:
    lines = [f"' {line}" for line in moves.comments]
    tool = 0 if moves.tool is None else settings.tool
    lines += ["Sub Main", "TakeArm Keep = 0", f"ChangeTool {tool}", "ChangeWork 0"]
    lines += [] if moves.tool is None else _tool_check(tool, moves.tool)
    for stop in moves.stops:
        out, on = (
            f"Move L, @E P({listed(pose, 6, 8)}), S = {settings.speed_percent}"
            for pose in (stop.approach, stop.target)
        )
        lines += [
            f'Hold "{stop.title}: is the way to the approach free?"',
            out,
            f'Hold "{stop.title}: go to {moves.goal}?"',
            on,
            f'Hold "{stop.title}: {moves.to_do}, then go back"',
            out,
        ]
    return [*lines, "GiveArm", "End Sub"]


CHECK = check_export("denso", "Denso", ".pcs", "yaskawa", _Check, _program)
