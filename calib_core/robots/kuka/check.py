"""KUKA: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_programs import NumberedCheck, Sides, check_export
from calib_core.exports.writing import fixed


def _pose(pose: list[float]) -> str:
    return "{" + ",".join(f"{n} {fixed(v, 6)}" for n, v in zip("XYZABC", pose, strict=True)) + "}"


def _program(comments: Sequence[str], sides: Sides, settings: NumberedCheck) -> list[str]:
    lines = ["DEF scancell_check()", *(f"; {line}" for line in comments), "BAS(#INITMOV,0)"]
    lines += [f"$TOOL=TOOL_DATA[{settings.tool}]", "$BASE=$NULLFRAME", f"$VEL.CP={settings.speed_mm_s / 1000:.3f}"]
    for number, (approach, target) in enumerate(sides, start=1):
        lines += [
            f"; side {number}: go to the approach by hand if the way there is not free",
            "HALT",
            f"LIN {_pose(approach)}",
            "HALT",
            f"LIN {_pose(target)}",
            "; read the scanner now",
            "HALT",
            f"LIN {_pose(approach)}",
        ]
    return [*lines, "END"]


CHECK = check_export("kuka", "KUKA", ".src", "kuka", NumberedCheck, _program)
