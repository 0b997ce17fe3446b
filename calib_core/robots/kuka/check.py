"""KUKA: moves from pose to pose as a program."""

from calib_core.exports.check_programs import Moves, NumberedCheck, check_export
from calib_core.exports.writing import fixed


def _pose(pose: list[float]) -> str:
    return "{" + ",".join(f"{n} {fixed(v, 6)}" for n, v in zip("XYZABC", pose, strict=True)) + "}"


def _tool_check(name: str, tool: list[float]) -> list[str]:
    """Return the lines that end the program where the controller's tool is not the answer."""
    lines: list[str] = []
    for axes, values in (("XYZ", tool[:3]), ("ABC", tool[3:])):
        differs = " OR ".join(
            f"(ABS({name}.{axis}-({fixed(value, 6)}))>0.05)" for axis, value in zip(axes, values, strict=True)
        )
        lines += [f"IF {differs} THEN", f"; {name} is not the calibrated tool: enter it first"]
        lines += ["HALT", "RETURN", "ENDIF"]
    return lines


def _program(moves: Moves, settings: NumberedCheck) -> list[str]:
    lines = [f"DEF scancell_{moves.name}()", *(f"; {line}" for line in moves.comments), "BAS(#INITMOV,0)"]
    tool = "$NULLFRAME" if moves.tool is None else f"TOOL_DATA[{settings.tool}]"
    lines += [f"$TOOL={tool}", "$BASE=$NULLFRAME", f"$VEL.CP={settings.speed_mm_s / 1000:.3f}"]
    if moves.tool is not None:
        lines += _tool_check(tool, moves.tool)
    for stop in moves.stops:
        lines += [
            f"; {stop.title}: go to the approach by hand if the way there is not free",
            "HALT",
            f"LIN {_pose(stop.approach)}",
            "HALT",
            f"LIN {_pose(stop.target)}",
            f"; {moves.to_do} now",
            "HALT",
            f"LIN {_pose(stop.approach)}",
        ]
    return [*lines, "END"]


CHECK = check_export("kuka", "KUKA", ".src", "kuka", NumberedCheck, _program)
