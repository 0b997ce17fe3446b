"""Universal Robots: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import Sides, check_export
from calib_core.exports.writing import fixed


def _pose(pose: list[float]) -> str:
    return "p[" + ", ".join(fixed(v, 9) for v in pose) + "]"


def _program(comments: Sequence[str], sides: Sides, settings: CheckSettings) -> list[str]:
    lines = ["def scancell_check():", *(f"  # {line}" for line in comments)]
    lines.append("  # the TCP is the active one: enter it and make it active first")
    speed = f"a=0.1, v={settings.speed_mm_s / 1000:.3f}"
    for number, (approach, target) in enumerate(sides, start=1):
        lines += [
            f'  popup("Side {number}: is the way to the approach free?", blocking=True)',
            f"  movel({_pose(approach)}, {speed})",
            f'  popup("Side {number}: go to the sphere?", blocking=True)',
            f"  movel({_pose(target)}, {speed})",
            f'  popup("Side {number}: read the scanner, then go back", blocking=True)',
            f"  movel({_pose(approach)}, {speed})",
        ]
    return [*lines, "end"]


CHECK = check_export("ur", "Universal Robots", ".script", "ur", CheckSettings, _program)
