"""ROS 2: transforms as YAML, in the fields of geometry_msgs/TransformStamped."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.neutral import FrameSettings, edges, position_and_quaternion
from calib_core.exports.writing import provenance


def _write(answer: Answer, settings: FrameSettings) -> str:
    lines = [f"# {line}" for line in provenance(answer)] + ["transforms:"]
    for parent, child, frame in edges(answer, settings):
        (x, y, z), (qx, qy, qz, qw) = position_and_quaternion(frame)
        lines += [
            "  - header:",
            f'      frame_id: "{parent}"',
            f'    child_frame_id: "{child}"',
            "    transform:",
            f"      translation: {{x: {x}, y: {y}, z: {z}}}",
            f"      rotation: {{x: {qx}, y: {qy}, z: {qz}, w: {qw}}}",
        ]
    return "\n".join(lines) + "\n"


EXPORT = Export(
    "ros2-yaml",
    "ROS 2: static transforms as YAML",
    "application/yaml",
    ".yaml",
    _write,
    FrameSettings,
    open_too=True,
)
