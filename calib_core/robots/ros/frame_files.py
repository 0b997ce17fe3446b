"""Fixed frames as ROS keeps them: joints of a URDF, static transforms of a launch file, MoveIt's calibration."""

import re
from collections.abc import Iterator

from calib_core.formats.shared.number import number
from calib_core.formats.shared.xml_file import elements
from calib_core.frames import RigidTransform
from calib_core.messages import explained, message
from calib_core.poses.numbers import to_pose
from calib_core.poses.rotations import rotation_from_angles
from calib_core.robots.controller_file import Found
from calib_core.robots.phrases import CALCULATED, require_count
from calib_core.robots.text import Source

Edge = tuple[str, str, tuple[float, ...], int]
"""Parent, child, x y z qx qy qz qw, line."""

_PUBLISHER = re.compile(r"static_transform_publisher")
_WORD = re.compile(
    r"--(x|y|z|qx|qy|qz|qw|roll|pitch|yaw|frame-id|child-frame-id)['\"]?[\s,=]+['\"]?([^\s'\",\]]+)"
)
_ORDER = ("x", "y", "z", "qx", "qy", "qz", "qw")


def is_urdf(text: str) -> bool:
    """Return whether a text is a robot's description."""
    return text.lstrip().startswith("<") and "<joint" in text


def urdf_edges(source: Source, found: Found) -> Iterator[Edge]:
    """Yield the fixed joints of a URDF or xacro; raises InputError where it is no XML."""
    rows = elements(source.text.encode(), source.name)
    for joint in rows:
        if joint.name != "joint" or joint.attributes.get("type") != "fixed":
            continue
        inside = {row.name: row.attributes for row in rows if row.path and row.path[-1] is joint}
        parent, child = (inside.get(name, {}).get("link", "") for name in ("parent", "child"))
        origin = inside.get("origin", {})
        try:
            place = _three(origin.get("xyz", "0 0 0"))
            roll, pitch, yaw = _three(origin.get("rpy", "0 0 0"))
            yield parent, child, _numbers(place, roll, pitch, yaw), joint.line
        except ValueError as error:
            found.skip(
                joint.line,
                message("joint {attributes}: {error}", attributes=joint.attributes.get("name", ""), error=error),
            )


def launch_edges(source: Source, found: Found) -> Iterator[Edge]:
    """Yield what static_transform_publisher is told, in a launch file or on a command line."""
    starts = [match.start() for match in _PUBLISHER.finditer(source.text)]
    for begin, end in zip(starts, [*starts[1:], len(source.text)], strict=True):
        words = dict(_WORD.findall(source.text[begin:end]))
        line = source.line(begin)
        parent, child = words.get("frame-id"), words.get("child-frame-id")
        if parent is None or child is None:
            found.skip(
                line,
                message(
                    "static_transform_publisher without --frame-id and --child-frame-id: {calculated}",
                    calculated=CALCULATED,
                ),
            )
            continue
        try:
            values = {name: _value(words[name]) for name in words if "frame" not in name}
            place = tuple(values.get(axis, 0.0) for axis in "xyz")
            if values.keys() & {"qx", "qy", "qz", "qw"}:
                rest = {"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0} | values
                yield parent, child, (*place, *(rest[name] for name in _ORDER[3:])), line
            else:
                angles = (values.get(name, 0.0) for name in ("roll", "pitch", "yaw"))
                yield parent, child, _numbers(place, *angles), line
        except ValueError as error:
            found.skip(line, explained(f"{child} in {parent}", error))


def _three(text: str) -> tuple[float, ...]:
    parts = text.split()
    if "$" in text:
        raise ValueError(CALCULATED)
    require_count(parts, 3)
    return tuple(map(number, parts))


def _value(text: str) -> float:
    try:
        return number(text)
    except ValueError:
        raise ValueError(f"'{text[:40]}': {CALCULATED}") from None


def _numbers(place_m: tuple[float, ...], roll: float, pitch: float, yaw: float) -> tuple[float, ...]:
    """Return the numbers of a transform with URDF's angles: about the fixed axes x, then y, then z."""
    rotation = rotation_from_angles("ZYX", [yaw, pitch, roll])
    frame = RigidTransform.of(rotation, [1000.0 * v for v in place_m], "base", "tool0")
    return tuple(to_pose("ros", frame))
