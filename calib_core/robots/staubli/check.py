"""Stäubli VAL 3: moves from pose to pose as an application, in a zip: its project, data and programs."""

from collections.abc import Sequence

from calib_core.exports.check_programs import Moves, NamedCheck, check_export
from calib_core.formats.zip_files import zipped
from calib_core.robots.staubli.writer import pose_attributes, tool_data

_XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
_XML = '<?xml version="1.0" encoding="utf-8"?>'
_PROJECT = (
    _XML
    + """
<Project xmlns="http://www.staubli.com/robotics/VAL3/Project/3">
  <Parameters version="s7.5.3" stackSize="5000" millimeterUnit="true" />
  <Programs>
    <Program file="start.pgx" />
    <Program file="stop.pgx" />
  </Programs>
  <Database>
    <Data file="%s.dtx" />
  </Database>
  <Libraries />
</Project>
"""
)
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


def _steps(moves: Moves, tool: str) -> list[str]:
    lines: list[str] = []
    for k, stop in enumerate(moves.stops):
        out, on = (f"movel({point}[{k}], {tool}, mCheck)" for point in ("pApproach", "pSphere"))
        lines += [
            f'putln("{stop.title}: is the way to the approach free? Press a key")', "get()", out, "waitEndMove()",
            f'putln("{stop.title}: go to {moves.goal}? Press a key")', "get()", on, "waitEndMove()",
            f'putln("{stop.title}: {moves.to_do}, then press a key")', "get()", out, "waitEndMove()",
        ]  # fmt: skip
    return lines


def _program(moves: Moves, settings: NamedCheck) -> bytes:
    """Return the application's folder as a zip; its tool is the answer's, as the export of the brand writes it."""
    name = f"scan{moves.name}"
    plain, _, key = settings.tool.rstrip("]").partition("[")
    tool = "flange" if moves.tool is None else f"{plain}[{key or 0}]"
    head = f'<Database {_XSI} xmlns="http://www.staubli.com/robotics/VAL3/Data/2">'
    noted = [f"    <!-- {line.replace('--', '-')} -->" for line in moves.comments]
    own = [] if moves.tool is None else [tool_data(tool, moves.tool)]
    data = [_XML, head, "  <Datas>", *noted, *own, _SPEED]
    data += _points("pApproach", [stop.approach for stop in moves.stops])
    data += _points("pSphere", [stop.target for stop in moves.stops])
    code = ["userPage()", "cls()", *(f"// {line}" for line in moves.comments)]
    code += [f"mCheck.tvel = {settings.speed_mm_s:g}", "mCheck.rvel = 10", "mCheck.blend = off"]
    code += _steps(moves, tool)
    files = {
        f"{name}.pjx": _PROJECT % name,
        f"{name}.dtx": "\n".join([*data, "  </Datas>", "</Database>", ""]),
        "start.pgx": _program_file("start", code),
        "stop.pgx": _program_file("stop", ["resetMotion()"]),
    }
    return zipped({f"{name}/{file}": text.encode() for file, text in files.items()})


CHECK = check_export("staubli", "Stäubli VAL 3", ".zip", "staubli", NamedCheck, _program)
