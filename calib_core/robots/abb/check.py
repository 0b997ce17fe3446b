"""ABB RAPID: moves from pose to pose as a program."""

from calib_core.exports.check_programs import Moves, NamedCheck, check_export
from calib_core.exports.writing import fixed

_NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def _target(pose: list[float]) -> str:
    position, rotation = (",".join(fixed(v, d) for v in part) for part, d in ((pose[:3], 6), (pose[3:], 12)))
    return f"[[{position}],[{rotation}],[0,0,0,0],{_NONE}]"


def _tool_check(name: str, tool: list[float]) -> list[str]:
    """Return the lines that end the routine where the controller's tool is not the answer."""
    place = ",".join(fixed(value, 6) for value in tool[:3])
    cosine = "+".join(
        f"{name}.tframe.rot.q{number}*({fixed(value, 12)})" for number, value in enumerate(tool[3:], start=1)
    )
    return [
        f"    IF Distance({name}.tframe.trans,[{place}])>0.05 OR Abs({cosine})<0.9999999 THEN",
        f'      TPWrite "{name} is not the calibrated tool: enter it first";',
        "      Stop;",
        "      RETURN;",
        "    ENDIF",
    ]


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
    if moves.tool is not None:
        lines += _tool_check(tool, moves.tool)
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
