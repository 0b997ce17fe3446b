"""URDF and xacro: fixed joints from the flange to the scanner and from the base to the turntable."""

from xml.sax.saxutils import quoteattr

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.neutral import FrameSettings, edges, position_and_quaternion, roll_pitch_yaw
from calib_core.exports.writing import provenance


class UrdfSettings(FrameSettings):
    """What the frames are called, and the name of the xacro macro: empty for bare joints."""

    macro: str = "scancell_frames"


def _write(answer: Answer, settings: UrdfSettings) -> str:
    lines = ['<?xml version="1.0"?>', *(f"<!-- {line.replace('--', '-')} -->" for line in provenance(answer))]
    lines.append('<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="scancell">')
    lines += [f"  <xacro:macro name={quoteattr(settings.macro)}>"] * bool(settings.macro)
    for parent, child, frame in edges(answer, settings):
        position, _ = position_and_quaternion(frame)
        lines += [
            f"    <link name={quoteattr(child)}/>",
            f'    <joint name={quoteattr(f"{parent}_to_{child}")} type="fixed">',
            f"      <parent link={quoteattr(parent)}/>",
            f"      <child link={quoteattr(child)}/>",
            f'      <origin xyz="{" ".join(position)}" rpy="{" ".join(roll_pitch_yaw(frame))}"/>',
            "    </joint>",
        ]
    lines += ["  </xacro:macro>"] * bool(settings.macro)
    return "\n".join([*lines, "</robot>"]) + "\n"


EXPORT = Export(
    "urdf", "URDF/xacro: fixed joints", "application/xml", ".xacro", _write, UrdfSettings, open_too=True
)
