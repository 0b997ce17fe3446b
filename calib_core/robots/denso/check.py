"""Denso: the check move as a program; its controllers take speeds in percent."""

from collections.abc import Sequence

from pydantic import Field

from calib_core.exports.check_programs import NumberedCheck, Sides, check_export
from calib_core.exports.writing import listed


class _Check(NumberedCheck):
    """Which tool of the controller is checked, and at how many percent of the arm's speed."""

    speed_percent: int = Field(default=2, ge=1, le=10)


def _program(comments: Sequence[str], sides: Sides, settings: _Check) -> list[str]:
    lines = [f"' {line}" for line in comments]
    lines += ["Sub Main", "TakeArm Keep = 0", f"ChangeTool {settings.tool}", "ChangeWork 0"]
    for number, (approach, target) in enumerate(sides, start=1):
        out, on = (
            f"Move L, @E P({listed(pose, 6, 8)}), S = {settings.speed_percent}" for pose in (approach, target)
        )
        lines += [
            f'Hold "Side {number}: is the way to the approach free?"',
            out,
            f'Hold "Side {number}: go to the sphere?"',
            on,
            f'Hold "Side {number}: read the scanner, then go back"',
            out,
        ]
    return [*lines, "GiveArm", "End Sub"]


CHECK = check_export("denso", "Denso", ".pcs", "yaskawa", _Check, _program)
