"""KUKA KRL with EthernetKRL: a program, and the connection's configuration."""

from collections.abc import Mapping, Sequence
from xml.sax.saxutils import quoteattr

from calib_core.robots.programs.program import HEAD, LONGEST_SAID, Plan, Program, number

_LETTERS = "XYZABC"
_SEND = 'RET=EKI_Send("Scancell","Shot")\r\n'


def _pose(pose: Sequence[float]) -> str:
    return "{" + ",".join(f"{n} {number(v, 4)}" for n, v in zip(_LETTERS, pose, strict=True)) + "}"


def _source(plan: Plan) -> str:
    lines = [
        "&ACCESS RVP",
        "DEF SCANCELL( )",
        *(f"; {line}" for line in HEAD),
        "DECL EKI_STATUS RET",
        "BAS(#INITMOV,0)",
        "$TOOL=$NULLFRAME",
        "$BASE=$NULLFRAME",
        f"$VEL.CP={plan.speed_mm_s / 1000:.3f}",
        "$APO.CDIS=0",
        'RET=EKI_Init("Scancell")',
        'RET=EKI_Open("Scancell")',
        f'RET=EKI_SetString("Scancell","Hello/@Token","{plan.token}")',
        'RET=EKI_Send("Scancell","Hello")',
        "SCANCELL_WAIT( )",
    ]
    for stop in plan.stops:
        lines += [
            f"; {stop.name}: is the way to the approach free?",
            "HALT",
            f"LIN {_pose(stop.approach)}",
            f"LIN {_pose(stop.pose)}",
            "WAIT SEC 0.5",
            f'SCANCELL_SHOT("{stop.name}")',
            f"LIN {_pose(stop.approach)}",
        ]
    lines += [
        'RET=EKI_SetInt("Scancell","End/@Done",1)',
        'RET=EKI_Send("Scancell","End")',
        "SCANCELL_WAIT( )",
        'RET=EKI_Close("Scancell")',
        'RET=EKI_Clear("Scancell")',
        "END",
        "",
        "DEF SCANCELL_SHOT(NAME[]:IN)",
        "; sends where the flange is; HALT asks the operator where the answer is NO",
        "DECL CHAR NAME[]",
        "DECL EKI_STATUS RET",
        "DECL FRAME AT",
        "WAIT SEC 0",
        "AT=$POS_ACT",
        'RET=EKI_SetString("Scancell","Shot/@Capture",NAME[])',
        *(f'RET=EKI_SetReal("Scancell","Shot/Pose/@{letter}",AT.{letter})' for letter in _LETTERS),
        'RET=EKI_Send("Scancell","Shot")',
        "SCANCELL_WAIT( )",
        "END",
        "",
        "DEF SCANCELL_WAIT( )",
        "DECL EKI_STATUS RET",
        "DECL INT OK,I",
        f"DECL CHAR TEXT[{LONGEST_SAID + 2}]",
        "OK=0",
        f"FOR I=1 TO {LONGEST_SAID + 2}",
        "TEXT[I]=0",
        "ENDFOR",
        "WAIT FOR $FLAG[2]",
        "$FLAG[2]=FALSE",
        'RET=EKI_GetInt("Scancell","Answer/@Ok",OK)',
        'RET=EKI_GetString("Scancell","Answer/@Text",TEXT[])',
        "IF OK<>1 THEN",
        "MsgNotify(TEXT[])",
        "HALT",
        "ENDIF",
        "END",
    ]
    return "\r\n".join(lines) + "\r\n"


def _configuration(plan: Plan) -> str:
    extra = [f'      <ELEMENT Tag="Shot/@{name.title()}" Type="STRING"/>' for name in _fields(plan)]
    lines = [
        "<ETHERNETKRL>",
        "  <CONFIGURATION>",
        f"    <EXTERNAL><IP>{plan.host}</IP><PORT>{plan.port}</PORT><TYPE>Server</TYPE></EXTERNAL>",
        '    <INTERNAL><ALIVE Set_Flag="1"/></INTERNAL>',
        "  </CONFIGURATION>",
        "  <RECEIVE>",
        "    <XML>",
        '      <ELEMENT Tag="Answer/@Ok" Type="INT"/>',
        '      <ELEMENT Tag="Answer/@Text" Type="STRING"/>',
        '      <ELEMENT Tag="Answer" Set_Flag="2"/>',
        "    </XML>",
        "  </RECEIVE>",
        "  <SEND>",
        "    <XML>",
        '      <ELEMENT Tag="Hello/@Token"/>',
        '      <ELEMENT Tag="Shot/@Capture"/>',
        *extra,
        *(f'      <ELEMENT Tag="Shot/Pose/@{letter}"/>' for letter in _LETTERS),
        '      <ELEMENT Tag="End/@Done"/>',
        "    </XML>",
        "  </SEND>",
        "</ETHERNETKRL>",
    ]
    return "\r\n".join(lines) + "\r\n"


def _fields(plan: Plan) -> dict[str, str]:
    return dict(word.split("=", 1) for word in plan.fields.split())


def write(plan: Plan) -> Mapping[str, str]:
    """Return the program and the configuration that belongs into EthernetKRL's folder."""
    source = _source(plan)
    for name, value in _fields(plan).items():
        told = f'RET=EKI_SetString("Scancell","Shot/@{name.title()}",{quoteattr(value)})\r\n'
        source = source.replace(_SEND, told + _SEND)
    return {"scancell.src": source, "Scancell.xml": _configuration(plan)}


PROGRAM = Program("krl", "KUKA KRL", "kuka", write, "EthernetKRL")
