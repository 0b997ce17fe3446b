"""ABB RAPID with socket messaging."""

from collections.abc import Mapping, Sequence

from calib_core.robots.programs.program import HEAD, Plan, Program, number

_NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def _target(pose: Sequence[float]) -> str:
    position, rotation = (",".join(number(v, d) for v in part) for part, d in ((pose[:3], 4), (pose[3:], 8)))
    return f"[[{position}],[{rotation}],[0,0,0,0],{_NONE}]"


def write(plan: Plan) -> Mapping[str, str]:
    """Return the module; strings of RAPID hold 80 characters, so that a line goes out in pieces."""
    lines = ["MODULE Scancell", *(f"  ! {line}" for line in HEAD)]
    for index, stop in enumerate(plan.stops, start=1):
        lines.append(f"  CONST robtarget pOut{index}:={_target(stop.approach)};")
        lines.append(f"  CONST robtarget pAt{index}:={_target(stop.pose)};")
    lines += [
        f"  CONST speeddata vScan:=[{plan.speed_mm_s:g},20,{plan.speed_mm_s:g},20];",
        "  VAR socketdev cell;",
        "  PROC ScancellCaptures()",
        "    ConfL\\Off;",
        "    SocketCreate cell;",
        f'    SocketConnect cell,"{plan.host}",{plan.port};',
        f'    SocketSend cell\\Str:="{plan.token}";',
        "    Answered;",
    ]
    for index, stop in enumerate(plan.stops, start=1):
        lines += [
            f"    ! {stop.name}: is the way to the approach free?",
            "    Stop;",
            f"    MoveL pOut{index},vScan,fine,tool0\\WObj:=wobj0;",
            f"    MoveL pAt{index},vScan,fine,tool0\\WObj:=wobj0;",
            "    WaitTime\\InPos,0.5;",
            f'    Shot "{stop.name}";',
            f"    MoveL pOut{index},vScan,fine,tool0\\WObj:=wobj0;",
        ]
    fields = f" {plan.fields}" if plan.fields else ""
    lines += [
        '    SocketSend cell\\Str:="done";',
        "    Answered;",
        "    SocketClose cell;",
        "  ENDPROC",
        "  PROC Shot(string name)",
        "    VAR robtarget at;",
        "    at:=CRobT(\\Tool:=tool0\\WObj:=wobj0);",
        '    SocketSend cell\\Str:=name+" "+NumToStr(at.trans.x,3)+" "+NumToStr(at.trans.y,3);',
        '    SocketSend cell\\Str:=" "+NumToStr(at.trans.z,3)+" "+NumToStr(at.rot.q1,8);',
        '    SocketSend cell\\Str:=" "+NumToStr(at.rot.q2,8)+" "+NumToStr(at.rot.q3,8);',
        f'    SocketSend cell\\Str:=" "+NumToStr(at.rot.q4,8)+"{fields}";',
        "    Answered;",
        "  ENDPROC",
        "  PROC Answered()",
        "    ! the end of the line that was sent, then the answer; Stop asks the operator where it is NO",
        "    VAR string said;",
        '    SocketSend cell\\Str:="\\0D\\0A";',
        "    SocketReceive cell\\Str:=said\\Time:=20;",
        "    TPWrite said;",
        '    IF StrMatch(said,1,"OK")<>1 THEN',
        "      Stop;",
        "    ENDIF",
        "  ENDPROC",
        "ENDMODULE",
    ]
    return {"Scancell.mod": "\r\n".join(lines) + "\r\n"}


PROGRAM = Program("rapid", "ABB RAPID", "abb", write, "PC Interface (616-1)")
