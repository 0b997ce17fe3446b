"""Stäubli VAL 3: the check move as an application, in a zip: its project, data and programs."""

from collections.abc import Sequence

from calib_core.exports.answer import Answer
from calib_core.exports.check_programs import NamedCheck, check_parts
from calib_core.exports.entry import Export
from calib_core.exports.writing import tool_pose
from calib_core.formats.zip_files import zipped
from calib_core.robots.staubli.writer import pose_attributes, tool_data

_NAME = "scancheck"
_XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
_XML = '<?xml version="1.0" encoding="utf-8"?>'
_PROJECT = f"""{_XML}
<Project xmlns="http://www.staubli.com/robotics/VAL3/Project/3">
  <Parameters version="s7.5.3" stackSize="5000" millimeterUnit="true" />
  <Programs>
    <Program file="start.pgx" />
    <Program file="stop.pgx" />
  </Programs>
  <Database>
    <Data file="{_NAME}.dtx" />
  </Database>
  <Libraries />
</Project>
"""
_SPEED = '    <Data name="mCheck" access="private" xsi:type="array" type="mdesc" size="1" />'


def _points(name: str, poses: Sequence[list[float]]) -> list[str]:
    rows = [
        f'      <Value key="{k}" {pose_attributes(pose)} fatherId="world[0]" />' for k, pose in enumerate(poses)
    ]
    head = f'    <Data name="{name}" access="private" xsi:type="array" type="pointRx" size="{len(poses)}">'
    return [head, *rows, "    </Data>"]


def _program_file(name: str, code: Sequence[str]) -> str:
    body = "\n".join(["begin", *(f"  {line}" for line in code), "end"])
    head = f'<Programs {_XSI} xmlns="http://www.staubli.com/robotics/VAL3/Program/2">\n  <Program name="{name}">'
    return f"{_XML}\n{head}\n    <Code><![CDATA[{body}]]></Code>\n  </Program>\n</Programs>\n"


def _steps(count: int, tool: str) -> list[str]:
    lines: list[str] = []
    for k in range(count):
        out, on = (f"movel({point}[{k}], {tool}, mCheck)" for point in ("pApproach", "pSphere"))
        lines += [
            f'putln("Side {k + 1}: is the way to the approach free? Press a key")', "get()", out, "waitEndMove()",
            f'putln("Side {k + 1}: go to the sphere? Press a key")', "get()", on, "waitEndMove()",
            f'putln("Side {k + 1}: read the scanner, then press a key")', "get()", out, "waitEndMove()",
        ]  # fmt: skip
    return lines


def _write(answer: Answer, settings: NamedCheck) -> bytes:
    """Return the application's folder as a zip; its tool is the answer's, as the export of the brand writes it."""
    comments, sides = check_parts(answer, settings, "staubli")
    plain, _, key = settings.tool.rstrip("]").partition("[")
    tool = f"{plain}[{key or 0}]"
    head = f'<Database {_XSI} xmlns="http://www.staubli.com/robotics/VAL3/Data/2">'
    noted = [f"    <!-- {line.replace('--', '-')} -->" for line in comments]
    data = [_XML, head, "  <Datas>", *noted, tool_data(tool, tool_pose(answer, "staubli")), _SPEED]
    for name, side in (("pApproach", 0), ("pSphere", 1)):
        data += _points(name, [pair[side] for pair in sides])
    code = ["userPage()", "cls()", *(f"// {line}" for line in comments)]
    code += [f"mCheck.tvel = {settings.speed_mm_s:g}", "mCheck.rvel = 10", "mCheck.blend = off"]
    code += _steps(len(sides), tool)
    files = {
        f"{_NAME}.pjx": _PROJECT,
        f"{_NAME}.dtx": "\n".join([*data, "  </Datas>", "</Database>", ""]),
        "start.pgx": _program_file("start", code),
        "stop.pgx": _program_file("stop", ["resetMotion()"]),
    }
    return zipped({f"{_NAME}/{name}": text.encode() for name, text in files.items()})


CHECK = Export(
    "staubli-check-move", "Stäubli VAL 3: check move", "application/zip", ".zip", _write, NamedCheck, "staubli"
)
