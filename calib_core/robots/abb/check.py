"""ABB RAPID: moves from pose to pose as a program."""

from calib_core.exports.check_programs import Moves, NamedCheck, check_export
from calib_core.exports.writing import fixed

_NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def _target(pose: list[float]) -> str:
    position, rotation = (",".join(fixed(v, d) for v in part) for part, d in ((pose[:3], 6), (pose[3:], 12)))
    return f"[[{position}],[{rotation}],[0,0,0,0],{_NONE}]"


def _program(moves: Moves, settings: NamedCheck) -> list[str]:
    lines = [f"MODULE Scancell{moves.name.title()}", *(f"  ! {line}" for line in moves.comments)]
    speed = f"[{settings.speed_mm_s:g},20,{settings.speed_mm_s:g},20]"
    for number, stop in enumerate(moves.stops, start=1):
        lines.append(f"  CONST robtarget pApproach{number}:={_target(stop.approach)};")
        lines.append(f"  CONST robtarget pSphere{number}:={_target(stop.target)};")
    lines += [
        f"  CONST speeddata vCheck:={speed};",
        f"  PROC Scancell{moves.name.title()}Move()",
        "    ConfL\\Off;",
    ]
    tool = "tool0" if moves.tool is None else settings.tool
    for number, stop in enumerate(moves.stops, start=1):
        move = f"vCheck,fine,{tool}\\WObj:=wobj0;"
        lines += [
            f"    ! {stop.title}: go to the approach by hand if the way there is not free",
            "    Stop;",
            f"    MoveL pApproach{number},{move}",
            "    Stop;",
            f"    MoveL pSphere{number},{move}",
            f"    ! {moves.to_do} now",
            "    Stop;",
            f"    MoveL pApproach{number},{move}",
        ]
    return [*lines, "  ENDPROC", "ENDMODULE"]


CHECK = check_export("abb", "ABB RAPID", ".mod", "abb", NamedCheck, _program)
