"""FANUC: a KAREL program that talks, and a TP program that moves and calls it."""

from collections.abc import Mapping, Sequence

from calib_core.robots.programs.program import HEAD, Plan, Program, number

_REMARK = 28
_NAMES = ("x", "y", "z", "w", "p", "r")


def _position(index: int, pose: Sequence[float]) -> list[str]:
    x, y, z, w, p, r = (number(v, 3) for v in pose)
    return [
        f"P[{index}]{{",
        "   GP1:",
        "\tUF : 0, UT : 10,\t\tCONFIG : 'N U T, 0, 0, 0',",
        f"\tX = {x}  mm,\tY = {y}  mm,\tZ = {z}  mm,",
        f"\tW = {w} deg,\tP = {p} deg,\tR = {r} deg",
        "};",
    ]


def _moves(plan: Plan) -> str:
    steps = [f"  !{line[:_REMARK]}" for line in HEAD]
    steps += ["  !tool 10 is the flange: zeros", "  UFRAME_NUM=0", "  UTOOL_NUM=10"]
    steps += ["  CALL SCANTALK('TOKEN')"]
    positions: list[str] = []
    speed = f"{max(round(plan.speed_mm_s), 1)}mm/sec FINE"
    for index, stop in enumerate(plan.stops, start=1):
        out, at = 2 * index - 1, 2 * index
        steps += [
            f"  !{stop.name[:10]}: is the way free?",
            "  PAUSE",
            f"L P[{out}] {speed}",
            f"L P[{at}] {speed}",
            "  WAIT    .50(sec)",
            f"  CALL SCANTALK('{stop.name}')",
            "  IF R[190]<>1,JMP LBL[999]",
            f"L P[{out}] {speed}",
        ]
        positions += [*_position(out, stop.approach), *_position(at, stop.pose)]
    steps += ["  CALL SCANTALK('DONE')", "  END", "  LBL[999]", "  !the answer was NO: see USER", "  PAUSE"]
    numbered = [f"{i:4d}:{step} ;" for i, step in enumerate(steps, start=1)]
    head = ["/PROG  SCANCELL", "/ATTR", 'COMMENT\t\t= "captures";', "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    return "\r\n".join([*head, *numbered, "/POS", *positions, "/END"]) + "\r\n"


def _talk(plan: Plan) -> str:
    fields = f"' {plan.fields}', " if plan.fields else ""
    numbers = ", ".join(f"' ', at.{name}::0::3" for name in _NAMES)
    lines = [
        "PROGRAM SCANTALK",
        "-- sends a capture's name and the flange's pose to scancell and waits for the answer",
        f"-- tag C3 is to be a socket client: {plan.host}, port {plan.port} (Setup, Host Comm)",
        "%NOLOCKGROUP",
        "%NOPAUSE=ERROR+COMMAND+TPENABLE",
        "%INCLUDE klevprop",
        "VAR",
        "  line: FILE",
        "  status, entry, kind, whole: INTEGER",
        "  real_value: REAL",
        "  name: STRING[32]",
        "  said: STRING[80]",
        "  at: XYZWPR",
        "BEGIN",
        "  GET_TPE_PRM(1, kind, whole, real_value, name, status)",
        "  SET_INT_REG(190, 0, status)",
        "  IF name = 'TOKEN' THEN",
        "    MSG_DISCO('C3:', status)",
        "    MSG_CONNECT('C3:', status)",
        "    SET_FILE_ATR(line, ATR_IA)",
        "    OPEN FILE line ('RW', 'C3:')",
        f"    WRITE line ('{plan.token}', CHR(13), CHR(10))",
        "  ELSE",
        "    OPEN FILE line ('RW', 'C3:')",
        "    IF name = 'DONE' THEN",
        "      WRITE line ('done', CHR(13), CHR(10))",
        "    ELSE",
        "      at = CURPOS(0, 0)",
        f"      WRITE line (name, {numbers}, {fields}CHR(13), CHR(10))",
        "    ENDIF",
        "  ENDIF",
        "  READ line (said)",
        "  CLOSE FILE line",
        "  WRITE (said, CR)",
        "  IF SUB_STR(said, 1, 2) = 'OK' THEN",
        "    SET_INT_REG(190, 1, status)",
        "  ENDIF",
        "END SCANTALK",
    ]
    return "\r\n".join(lines) + "\r\n"


def write(plan: Plan) -> Mapping[str, str]:
    """Return the TP program that moves and the KAREL program that talks."""
    return {"SCANCELL.LS": _moves(plan), "SCANTALK.KL": _talk(plan)}


PROGRAM = Program("karel", "FANUC TP and KAREL", "fanuc", write, "KAREL and User Socket Messaging (R648)")
