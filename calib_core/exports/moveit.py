"""MoveIt: the YAML in which its calibration packages keep a sensor's pose."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.neutral import FrameSettings, edges, position_and_quaternion
from calib_core.exports.writing import provenance


def _write(answer: Answer, settings: FrameSettings) -> str:
    lines = [f"# {line}" for line in provenance(answer)]
    for parent, child, frame in edges(answer, settings):
        (x, y, z), (qx, qy, qz, qw) = position_and_quaternion(frame)
        kind = "eye_in_hand" if parent == settings.flange else "eye_to_hand"
        lines += [
            "---" if len(lines) > len(provenance(answer)) else "# parameters of one sensor",
            "parameters:",
            f"  calibration_type: {kind}",
            f'  robot_effector_frame: "{settings.flange}"',
            f'  robot_base_frame: "{settings.base}"',
            f'  parent_frame: "{parent}"',
            f'  tracking_base_frame: "{child}"',
            f"transform: {{x: {x}, y: {y}, z: {z}, qx: {qx}, qy: {qy}, qz: {qz}, qw: {qw}}}",
        ]
    return "\n".join(lines) + "\n"


EXPORT = Export("moveit", "MoveIt: hand-eye calibration YAML", "application/yaml", ".yaml", _write, FrameSettings)
