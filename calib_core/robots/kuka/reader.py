"""KUKA KRL: positions, tools and bases of .dat, .src and $config.dat files.

A taught point `XP1` has its tool and base in `FP1` beside it (TOOL_NO, BASE_NO); a program of plain moves sets
`$TOOL` and `$BASE` on the way.
"""

import re
from dataclasses import replace

from calib_core.arms.configuration import Configuration
from calib_core.formats.shared.number import number
from calib_core.messages import explained, message
from calib_core.robots.controller_file import Found, Frame, Reference, Taught
from calib_core.robots.phrases import CALCULATED, TWICE, UNMATCHED
from calib_core.robots.text import closing, source_of, split_top, without_comments

_TYPES = "E6POS|POS|E3POS|FRAME|E6AXIS|E3AXIS|AXIS"
_ASSIGNED = re.compile(
    rf"^[ \t]*(?:DECL\s+)?(?:GLOBAL\s+)?(?:CONST\s+)?(?:({_TYPES}|FDAT|BASIS_SUGG_T|\w+)\s+)?"
    r"(\$?\w+(?:\[[^\]]*\])?)\s*=\s*(?=\{)",
    re.IGNORECASE,
)
_NAMED = re.compile(r'^[ \t]*(TOOL|BASE)_NAME\[\s*(\d+)\s*,\s*\]\s*=\s*"([^"]*)"', re.IGNORECASE)
_TYPED = re.compile(r"^[ \t]*(TOOL|BASE)_TYPE\[\s*(\d+)\s*\]\s*=\s*#(\w+)", re.IGNORECASE)
_SYSTEM = re.compile(r"^[ \t]*(?:DECL\s+)?(?:FRAME\s+)?\$?(TOOL|BASE)_DATA\[\s*(\d+)\s*\]$", re.IGNORECASE)
_ACTIVE = re.compile(r"^[ \t]*\$(TOOL|BASE)\s*=\s*(.+?)\s*$", re.IGNORECASE)
_BASIS = re.compile(r"\bBAS\s*\(\s*#(TOOL|BASE)\s*,\s*(\d+)\s*\)", re.IGNORECASE)
_MOVE = re.compile(r"^[ \t]*(S?PTP|S?LIN|S?CIRC|SPL)(_REL)?\b\s*(.*)$", re.IGNORECASE)
_CHANGED = re.compile(r"^[ \t]*\$?(\w+)(?:\[([\d\s]+)\])?\s*(?:\.\s*\w+\s*)?=(?!=)")
_TARGET = re.compile(r"(\w+(?:\[[\d\s,]+\])?)\s*(.?)")
_CALCULATES = (":", "[", "(", ".")
_BEGIN = re.compile(r"^[ \t]*(?:GLOBAL\s+)?(?:DEF|DEFFCT)\b", re.IGNORECASE)
_LIST = re.compile(r"^[ \t]*DEFDAT\s+(\$?)", re.IGNORECASE)
_POSE, _AXES = ("X", "Y", "Z", "A", "B", "C"), ("A1", "A2", "A3", "A4", "A5", "A6")
_EXTERNAL = ("E1", "E2", "E3", "E4", "E5", "E6")


def find(data: bytes, name: str) -> Found:
    """Return what stands in a KRL file."""
    return _Program(data, name).found()


class _Program:
    def __init__(self, data: bytes, name: str) -> None:
        self._source = source_of(data, name)
        self._found = Found(name)
        self._motion: dict[str, tuple[int, int, str, int]] = {}
        self._two_ways: dict[str, str] = {}
        self._names: dict[tuple[str, int], str] = {}
        self._types: dict[tuple[str, int], str] = {}
        self._system = self._is_list = False
        self._active: dict[str, Reference] = {}

    def found(self) -> Found:
        """Return all that the file holds."""
        text = without_comments(self._source.text, ";")
        for line, content in enumerate(text.split("\n"), start=1):
            if content.strip():
                self._line(line, content)
        self._found.poses = [self._with_motion(taught) for taught in self._found.poses]
        self._found.tools = [self._described("TOOL", frame) for frame in self._found.tools]
        self._found.frames = [self._described("BASE", frame) for frame in self._found.frames]
        return self._found

    def _line(self, line: int, content: str) -> None:
        if _BEGIN.match(content):
            self._active = {}
        elif listed := _LIST.match(content):
            self._is_list, self._system = True, bool(listed[1])
        elif named := _NAMED.match(content):
            self._names[named[1].upper(), int(named[2])] = named[3].strip()
        elif typed := _TYPED.match(content):
            self._types[typed[1].upper(), int(typed[2])] = typed[3].upper()
        elif active := _ACTIVE.match(content):
            self._activate(active[1].upper(), active[2], line)
        elif basis := _BASIS.search(content):
            self._active[basis[1].upper()] = int(basis[2])
        elif assigned := _ASSIGNED.match(content):
            self._assigned(assigned, content, line)
        elif move := _MOVE.match(content):
            self._move(move, line)
        elif change := _CHANGED.match(content):
            self._change(change, line)
        elif re.match(rf"\s*(?:DECL\s+)?(?:GLOBAL\s+)?(?:{_TYPES})\s+X?\w+.*=", content, re.IGNORECASE):
            self._found.skip(line, message("'{content}' has no list in braces", content=content.strip()[:60]))

    def _assigned(self, assigned: re.Match[str], content: str, line: int) -> None:
        kind, name = (assigned[1] or "").upper(), assigned[2]
        system = _SYSTEM.match(name)
        end = closing(content, assigned.end())
        wanted = system or kind in {*_TYPES.split("|"), "FDAT"} or (not kind and "[" in name)
        if not wanted:
            if not kind and not self._is_list:
                self._found.change("point", name, line)
            return
        try:
            if end < 0:
                raise ValueError(UNMATCHED)
            if content[end:].strip(" \t,"):
                raise ValueError(message("'{content}' stands behind it", content=content[end:].strip()[:40]))
            fields = _fields(content[assigned.end() : end])
            if system:
                self._frame(system, fields, line)
            elif kind == "FDAT":
                self._fdat(name, fields, line)
            elif self._system and not name.upper().startswith("X"):
                if any(number(fields.get(axis, "0")) for axis in "XYZ"):
                    self._found.skip(line, message("{name}: a variable of the system, no taught point", name=name))
            elif kind or "X" in fields or "A1" in fields:
                self._found.poses.append(self._position(name, fields, line))
        except ValueError as error:
            self._found.skip(line, explained(f"{name}", error), name.replace(" ", ""))

    def _change(self, change: re.Match[str], line: int) -> None:
        """Note what a program changes: a point of the list beside it, or a tool or base."""
        name, index = change[1].upper(), (change[2] or "").strip()
        if name in ("TOOL_DATA", "BASE_DATA") and index:
            self._found.change("tool" if name == "TOOL_DATA" else "frame", index, line)
        elif name in ("TOOL", "BASE"):
            self._active[name] = f"${name} (line {line})"
        else:
            self._found.change("point", f"{name}[{index}]" if index else name, line)

    def _frame(self, system: re.Match[str], fields: dict[str, str], line: int) -> None:
        what, index = system[1].upper(), int(system[2])
        frame = Frame(index, None, _numbers(fields, _POSE), "kuka", line, self._source.name)
        (self._found.tools if what == "TOOL" else self._found.frames).append(frame)

    def _described(self, what: str, frame: Frame) -> Frame:
        if not isinstance(frame.number, int):
            return frame
        kind = self._types.get((what, frame.number), "")
        moving = ""
        if what == "TOOL" and kind == "TCP":
            moving = message("stands still beside the robot (TOOL_TYPE[{number}] is #TCP)", number=frame.number)
        elif what == "BASE" and kind == "TCP":
            moving = message("is held by the robot (BASE_TYPE[{number}] is #TCP)", number=frame.number)
        return replace(frame, name=self._names.get((what, frame.number)) or None, moving=moving)

    def _fdat(self, name: str, fields: dict[str, str], line: int) -> None:
        tool, base = int(number(fields["TOOL_NO"])), int(number(fields["BASE_NO"]))
        known = self._motion.setdefault(name.upper(), (tool, base, fields.get("IPO_FRAME", "#BASE"), line))
        if known[:2] != (tool, base):
            self._two_ways[name.upper()] = message(
                "its FDAT names two tools or bases, in lines {known} and {line}", known=known[3], line=line
            )

    def _with_motion(self, taught: Taught) -> Taught:
        """Return a point with the tool and base that its FDAT names."""
        if not taught.name.upper().startswith("X") or taught.tool is not None:
            return taught
        named = "F" + taught.name.upper()[1:]
        motion = self._motion.get(named)
        if motion is None:
            return taught
        tool, base, interpolation, line = motion
        refused = self._two_ways.get(named, "")
        if not refused and interpolation.upper().strip() == "#TCP":
            refused = message(
                "its tool stands still and the robot holds the workpiece (IPO_FRAME is #TCP, line {line})",
                line=line,
            )
        return replace(
            taught, tool=tool if tool >= 0 else None, frame=base if base >= 0 else None, refused=refused
        )

    def _position(self, name: str, fields: dict[str, str], line: int) -> Taught:
        external = {axis: number(fields[axis]) for axis in _EXTERNAL if axis in fields} or None
        file = self._source.name
        if "A1" in fields:
            return Taught(name, None, "kuka", line, _numbers(fields, _AXES), external, file=file)
        pose, stands = _numbers(fields, _POSE), _configuration(fields)
        return Taught(name, pose, "kuka", line, None, external, file=file, configuration=stands)

    def _activate(self, what: str, value: str, line: int) -> None:
        """Follow ``$TOOL = …`` and ``$BASE = …``."""
        indexed = re.fullmatch(r"\$?(?:TOOL|BASE)_DATA\[\s*(\d+)\s*\]", value, re.IGNORECASE)
        if value.upper() == "$NULLFRAME":
            self._active[what] = 0
        elif indexed:
            self._active[what] = int(indexed[1])
        elif value.startswith("{"):
            self._active[what] = named = f"${what} of line {line}"
            try:
                if closing(value, 0) != len(value):
                    raise ValueError(UNMATCHED)
                frame = Frame(named, named, _numbers(_fields(value), _POSE), "kuka", line, self._source.name)
                (self._found.tools if what == "TOOL" else self._found.frames).append(frame)
            except ValueError as error:
                self._found.skip(line, explained(f"${what}", error))
        else:
            self._active[what] = f"{value[:40]} (line {line})"

    def _move(self, move: re.Match[str], line: int) -> None:
        kind, relative, rest = move[1], move[2], move[3]
        for _, target in split_top(rest)[: 2 if kind.upper().endswith("CIRC") else 1]:
            target = target.strip()
            if relative:
                self._found.skip(
                    line,
                    message(
                        "{move}: a relative move has no pose of its own", move=f"{kind}{relative} {target[:60]}"
                    ),
                )
                continue
            if target.startswith("{"):
                self._inline(kind, target, line)
            elif named := _TARGET.match(target):
                name = named[1].replace(" ", "")
                if named[2] in _CALCULATES:
                    self._found.skip(line, explained(f"{kind} {target[:60]}", CALCULATED))
                    continue
                self._found.want(name, line)
                if "F" + name.upper()[1:] not in self._motion and self._active:
                    self._found.moves.setdefault(name.lower(), set()).add(self._tool_and_base())

    def _inline(self, kind: str, target: str, line: int) -> None:
        end = closing(target, 0)
        try:
            if end < 0:
                raise ValueError(UNMATCHED)
            if target[end:].lstrip().startswith(":"):
                raise ValueError(CALCULATED)
            taught = self._position(f"line {line}", _fields(target[:end]), line)
        except ValueError as error:
            self._found.skip(line, explained(f"{kind} {target[:60]}", error))
            return
        tool, base = self._tool_and_base()
        self._found.poses.append(replace(taught, tool=tool, frame=base))

    def _tool_and_base(self) -> tuple[Reference | None, Reference | None]:
        return self._active.get("TOOL"), self._active.get("BASE")


def _configuration(fields: dict[str, str]) -> Configuration | None:
    """Return how the arm stands: of status the area and the elbow, of turn the sign of each axis.

    Status' third bit, of the wrist, has two readings in KUKA's manuals, and turn says it anyway.
    """
    status, turn = _bits(fields.get("S")), _bits(fields.get("T"))
    if turn is None:
        return None
    ranges = tuple(((-720.0, 0.0) if turn >> place & 1 else (0.0, 720.0),) for place in range(6))
    front, up = (None, None) if status is None else (not status & 1, bool(status & 2))
    return Configuration(ranges, front, up, (0.0, -90.0, 90.0, 0.0, 0.0, 0.0))


def _bits(text: str | None) -> int | None:
    """Return whole numbers as they stand, and binary ones such as 'B000110'; None for anything else."""
    binary = re.fullmatch(r"'B([01]+)'", (text or "").strip(), re.IGNORECASE)
    whole = re.fullmatch(r"(\d{1,4})(?:\.0*)?", (text or "").strip())
    return int(binary[1], 2) if binary else int(whole[1]) if whole else None


def _fields(text: str) -> dict[str, str]:
    """Return the values of a list such as ``{X 1.0,Y 2.0}`` or ``{E6POS: X 1.0}`` by their names."""
    inside = re.sub(r"^[ \t]*\w+\s*:", "", text.strip()[1:-1])
    fields: dict[str, str] = {}
    for _, part in split_top(inside):
        named = re.fullmatch(r"\s*([A-Za-z_]\w*)(?:\[\s*\])?\s+(\S.*?)\s*", part, re.DOTALL)
        if not named:
            raise ValueError(message("'{part}' is no name with a value", part=part.strip()[:40]))
        if named[1].upper() in fields:
            raise ValueError(f"{named[1]}: {TWICE}")
        fields[named[1].upper()] = named[2]
    return fields


def _numbers(fields: dict[str, str], names: tuple[str, ...]) -> tuple[float, ...]:
    missing = [name for name in names if name not in fields]
    if missing:
        raise ValueError(
            message("{missing} missing: a part of a position is not enough", missing=", ".join(missing))
        )
    return tuple(number(fields[name]) for name in names)
