"""ROS messages as YAML, as `ros2 topic echo` prints them or a program stores them, with their lines."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from calib_core.errors import InputError
from calib_core.formats.shared.number import number
from calib_core.messages import message
from calib_core.robots.controller_file import Found
from calib_core.robots.phrases import CUT_LINE
from calib_core.robots.text import Source

Numbers = tuple[float, ...]
_MOST_NODES = 2_000_000
_DEEPEST = 40

_UNNAMED = message("a transform without the names of its two frames")


@dataclass
class Message:
    """One document, or one entry of a list: its time, poses (frame, numbers, line) and transforms."""

    line: int
    time_s: float | None = None
    poses: list[tuple[str | None, Numbers, int]] = field(default_factory=list[tuple[str | None, Numbers, int]])
    transforms: list[tuple[str, str, Numbers, int]] = field(default_factory=list[tuple[str, str, Numbers, int]])


@dataclass(frozen=True)
class _Node:
    """A value with its line: a mapping, a list, or a text."""

    line: int
    fields: "dict[str, _Node] | None" = None
    items: "list[_Node] | None" = None
    text: str = ""
    cut: bool = False


@dataclass
class _Walk:
    """How many values may still come, and the last line where it has no end: it may be cut."""

    left: int
    last_line: int


def messages(source: Source, found: Found) -> Iterator[Message]:
    """Yield the messages of a text; what cannot be read is skipped aloud.

    Raises
    ------
    InputError
        If it is no YAML.
    """
    for root in _documents(source, found):
        entries = root.items if root.items is not None else [root]
        for entry in entries:
            message = Message(entry.line)
            _collect(entry, None, message, found, 0)
            if message.poses or message.transforms:
                yield message


def _documents(source: Source, found: Found) -> Iterator[_Node]:
    import yaml

    begin = 0
    pieces: list[tuple[int, str]] = []
    lines = source.text.split("\n")
    walk = _Walk(_MOST_NODES, len(lines) if lines[-1] else 0)
    for place, line in enumerate(lines):
        if line.rstrip() in ("---", "..."):
            pieces.append((begin, "\n".join(lines[begin:place])))
            begin = place + 1
    pieces.append((begin, "\n".join(lines[begin:])))
    whole = [(at, text) for at, text in pieces if text.strip()]
    for place, (at, text) in enumerate(whole):
        try:
            node = yaml.compose(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
            if node is not None:
                yield _node(node, at, walk, 0)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            mark = getattr(error, "problem_mark", None)
            line = at + 1 + (mark.line if mark else 0)
            problem = getattr(error, "problem", None) or str(error)
            if len(whole) == 1:
                got = "{word} in line {number}"
                to_do = "Save them again."
                raise InputError("messages as YAML", got, to_do, source.name, word=problem, number=line) from None
            said = message("a message that is no YAML: {problem}", problem=problem)
            if place == len(whole) - 1:
                said = message("a message that is no YAML, perhaps as the file is cut: {problem}", problem=problem)
            found.skip(line, said)


def _node(node: object, at: int, walk: _Walk, depth: int) -> _Node:
    import yaml

    walk.left -= 1
    if walk.left < 0 or depth > _DEEPEST:
        raise ValueError(message("too many values, or too deep ones"))
    if isinstance(node, yaml.MappingNode):
        line = at + 1 + node.start_mark.line
        fields: dict[str, _Node] = {}
        for key, value in node.value:
            if str(key.value) in fields:
                raise ValueError(
                    message(
                        "'{key}' stands twice in one value (line {at})",
                        key=key.value,
                        at=at + 1 + key.start_mark.line,
                    )
                )
            fields[str(key.value)] = _node(value, at, walk, depth + 1)
        return _Node(line, fields)
    if isinstance(node, yaml.SequenceNode):
        line = at + 1 + node.start_mark.line
        return _Node(line, items=[_node(value, at, walk, depth + 1) for value in node.value])
    assert isinstance(node, yaml.ScalarNode)
    line = at + 1 + node.start_mark.line
    return _Node(line, text=str(node.value), cut=line == walk.last_line)


def _collect(node: _Node, header: _Node | None, message: Message, found: Found, depth: int) -> None:
    """Walk through a value; a header holds for what stands beside and below it."""
    if node.items is not None:
        for item in node.items:
            _collect(item, header, message, found, depth + 1)
        return
    if node.fields is None:
        return
    fields = node.fields
    header = fields.get("header", header)
    if "header" in fields:
        message.time_s = _time(fields["header"])
    try:
        if "position" in fields and "orientation" in fields:
            numbers = (*_xyz(fields["position"]), *_xyzw(fields["orientation"]))
            message.poses.append((_word(header, "frame_id"), numbers, node.line))
            return
        if "transform" in fields and "parameters" in fields:
            message.transforms.append(_moveit(fields["parameters"], fields["transform"]))
            return
        if "transform" in fields and "child_frame_id" in fields:
            inner = fields["transform"].fields or {}
            numbers = (*_xyz(inner.get("translation")), *_xyzw(inner.get("rotation")))
            parent, child = _word(header, "frame_id"), fields["child_frame_id"].text.strip()
            if not parent or not child:
                raise ValueError(_UNNAMED)
            message.transforms.append((parent, child, numbers, node.line))
            return
    except ValueError as error:
        found.skip(node.line, str(error))
        return
    for name, value in fields.items():
        if name != "header":
            _collect(value, header, message, found, depth + 1)


def _moveit(parameters: _Node, transform: _Node) -> tuple[str, str, Numbers, int]:
    """Return the frame that MoveIt's calibration packages store."""
    words = {name: node.text.strip() for name, node in (parameters.fields or {}).items()}
    kind = words.get("calibration_type", words.get("eye_on_hand", ""))
    parent = words.get("parent_frame") or words.get(
        "robot_effector_frame" if kind in ("eye_in_hand", "true") else "robot_base_frame"
    )
    child = words.get("tracking_base_frame")
    if not parent or not child:
        raise ValueError(message("a calibration without the names of its two frames"))
    return parent, child, _named(transform, ("x", "y", "z", "qx", "qy", "qz", "qw"), "a transform"), transform.line


def _word(header: _Node | None, name: str) -> str | None:
    field_of = (header.fields or {}).get(name) if header else None
    return (field_of.text.strip() or None) if field_of else None


def _time(header: _Node) -> float | None:
    stamp = (header.fields or {}).get("stamp")
    parts = (stamp.fields or {}) if stamp else {}
    try:
        seconds = number(parts["sec"].text if "sec" in parts else parts["secs"].text)
        rest = parts.get("nanosec") or parts.get("nsecs")
        return seconds + 1e-9 * number(rest.text) if rest else seconds
    except (KeyError, ValueError):
        return None


def _xyz(node: _Node | None) -> Numbers:
    return _named(node, ("x", "y", "z"), "a position")


def _xyzw(node: _Node | None) -> Numbers:
    return _named(node, ("x", "y", "z", "w"), "an orientation")


def _named(node: _Node | None, names: Sequence[str], what: str) -> Numbers:
    if node is not None and node.items is not None:
        raise ValueError(message("{what} as a bare list: the order of its numbers is not said", what=what))
    fields = (node.fields or {}) if node else {}
    missing = [name for name in names if name not in fields]
    if missing:
        raise ValueError(message("{what} without {missing}", what=what, missing=", ".join(missing)))
    if any(fields[name].cut for name in names):
        raise ValueError(CUT_LINE)
    return tuple(number(fields[name].text) for name in names)
