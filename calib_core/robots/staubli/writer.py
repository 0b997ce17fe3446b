"""Stäubli VAL 3: a tool and a frame as .dtx data, alone or patched into an application's."""

import re

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.patching import only_match, patched_by, replaced
from calib_core.exports.writing import NamedSettings, fixed, frames_written, provenance
from calib_core.robots.staubli.units import require_millimetres

_NAMES = ("x", "y", "z", "rx", "ry", "rz")
_HEAD = """<?xml version="1.0" encoding="utf-8"?>
<Database xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xmlns="http://www.staubli.com/robotics/VAL3/Data/2">
  <Datas>"""


def pose_attributes(pose: list[float]) -> str:
    """Return a pose as the attributes of a value in .dtx data."""
    return " ".join(
        f'{n}="{fixed(v, 9 if i < 3 else 11)}"' for i, (n, v) in enumerate(zip(_NAMES, pose, strict=True))
    )


def _data(name: str, kind: str, pose: list[float], father: str) -> str:
    plain, _, key = name.rstrip("]").partition("[")
    size = int(key or 0) + 1
    return (
        f'    <Data name="{plain}" access="public" xsi:type="array" type="{kind}" size="{size}">\n'
        f'      <Value key="{key or 0}" {pose_attributes(pose)} fatherId="{father}" />\n'
        "    </Data>"
    )


def tool_data(name: str, pose: list[float]) -> str:
    """Return a tool in the flange as .dtx data."""
    return _data(name, "tool", pose, "flange[0]")


def write(answer: Answer, settings: NamedSettings) -> str:
    """Return a .dtx with the tool and the frame."""
    lines = [_HEAD, *(f"    <!-- {line.replace('--', '-')} -->" for line in provenance(answer))]
    for one in frames_written(answer, settings, "staubli", "both"):
        if one.kind == "tool":
            lines.append(tool_data(one.settings.tool, one.pose))
        else:
            lines.append(_data(one.settings.frame, "frame", one.pose, "world[0]"))
    return "\n".join([*lines, "  </Datas>", "</Database>"]) + "\n"


def _put(text: str, kind: str, pose: list[float], settings: NamedSettings, answer: Answer) -> str:
    """Return a .dtx with the numbers of one entry changed."""
    father = "flange" if kind == "tool" else "world"
    plain, _, key = getattr(settings, kind).rstrip("]").partition("[")
    data = only_match(rf'<Data\b(?=[^>]*\bname="{plain}")(?=[^>]*\btype="{kind}")[^>]*>(.*?)</Data>', text,
                      f'{kind} "{plain}"', re.DOTALL)  # fmt: skip
    pattern = rf'<Value\b(?=[^>]*\bkey="{key or 0}")(?=[^>]*fatherId="{father}(?:\[0\])?")([^>]*?)(/?>)'
    value = only_match(pattern, data[1], f'{kind} "{plain}[{key or 0}]", {father}', 0)
    kept = re.sub(r'\s+(?:x|y|z|rx|ry|rz)="[^"]*"', "", value[1])
    first = re.match(r'(\s*key="[^"]*")?', kept)
    at = first.end() if first else 0
    new = f"{kept[:at]} {pose_attributes(pose)}{kept[at:]}"
    return replaced(text, data.start(1) + value.start(1), data.start(1) + value.end(1), new)


EXPORT = Export(
    "staubli", "Stäubli VAL 3: tool and frame (.dtx)", "application/xml", ".dtx", write, NamedSettings, "staubli",
    patched_by("staubli", _put), suits=require_millimetres,
)  # fmt: skip
