"""ABB RAPID: the check move as a program."""

from collections.abc import Sequence

from calib_core.exports.check_programs import NamedCheck, Sides, check_export
from calib_core.exports.writing import fixed

_NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def _target(pose: list[float]) -> str:
    position, rotation = (",".join(fixed(v, d) for v in part) for part, d in ((pose[:3], 6), (pose[3:], 12)))
    return f"[[{position}],[{rotation}],[0,0,0,0],{_NONE}]"


def _program(comments: Sequence[str], sides: Sides, settings: NamedCheck) -> list[str]:
    lines = ["MODULE ScancellCheck", *(f"  ! {line}" for line in comments)]
    speed = f"[{settings.speed_mm_s:g},20,{settings.speed_mm_s:g},20]"
    for number, (approach, target) in enumerate(sides, start=1):
        lines.append(f"  CONST robtarget pApproach{number}:={_target(approach)};")
        lines.append(f"  CONST robtarget pSphere{number}:={_target(target)};")
    lines += [f"  CONST speeddata vCheck:={speed};", "  PROC ScancellCheckMove()", "    ConfL\\Off;"]
    for number in range(1, len(sides) + 1):
        move = f"vCheck,fine,{settings.tool}\\WObj:=wobj0;"
        lines += [
            f"    ! side {number}: go to the approach by hand if the way there is not free",
            "    Stop;",
            f"    MoveL pApproach{number},{move}",
            "    Stop;",
            f"    MoveL pSphere{number},{move}",
            "    ! read the scanner now",
            "    Stop;",
            f"    MoveL pApproach{number},{move}",
        ]
    return [*lines, "  ENDPROC", "ENDMODULE"]


CHECK = check_export("abb", "ABB RAPID", ".mod", "abb", NamedCheck, _program)
