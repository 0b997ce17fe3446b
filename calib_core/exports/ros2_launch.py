"""ROS 2: a launch file that publishes static transforms."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.neutral import FrameSettings, edges, position_and_quaternion
from calib_core.exports.writing import provenance


def _write(answer: Answer, settings: FrameSettings) -> str:
    nodes: list[str] = []
    for parent, child, frame in edges(answer, settings):
        (x, y, z), (qx, qy, qz, qw) = position_and_quaternion(frame)
        arguments = ["--x", x, "--y", y, "--z", z, "--qx", qx, "--qy", qy, "--qz", qz, "--qw", qw]
        arguments += ["--frame-id", parent, "--child-frame-id", child]
        nodes.append(
            "            Node(\n"
            '                package="tf2_ros",\n'
            '                executable="static_transform_publisher",\n'
            f"                arguments={arguments!r},\n"
            "            ),\n"
        )
    comments = "".join(f"# {line}\n" for line in provenance(answer))
    return (
        f"{comments}from launch import LaunchDescription\n"
        "from launch_ros.actions import Node\n\n\n"
        "def generate_launch_description():\n"
        "    return LaunchDescription(\n        [\n" + "".join(nodes) + "        ]\n    )\n"
    )


EXPORT = Export(
    "ros2-launch",
    "ROS 2: launch file, static transforms",
    "text/x-python",
    ".launch.py",
    _write,
    FrameSettings,
    open_too=True,
)
