"""ABB RAPID: robtargets, jointtargets, tools and work objects, and the moves that say what belongs together.

A robtarget is the pose of a tool's centre in a work object; which ones, only a move says.  A work object's frame
in the base is its user frame times its object frame.
"""

import re
from collections.abc import Iterator
from dataclasses import replace

from calib_core.arms.configuration import ANYWHERE, Configuration
from calib_core.errors import InputError
from calib_core.formats.shared.number import number
from calib_core.frames import RigidTransform
from calib_core.messages import explained, message, sentences, templates
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.robots.abb.literal import Value, literal
from calib_core.robots.controller_file import Found, Frame, Reference, Taught
from calib_core.robots.phrases import CALCULATED, CUT, changed, shifted
from calib_core.robots.text import Source, source_of, split_top, unquoted, without_comments

_DECLARED = re.compile(
    r"\b(?:(?:LOCAL|TASK)\s+)?(CONST|VAR|PERS)\s+(\w+)\s+(\w+)\s*(\{[^}]*\})?\s*(:=|;|(?=\n)|$)", re.IGNORECASE
)
_MOVE = re.compile(
    r"(?:^|;|\bTHEN\b|\bDO\b)[ \t]*((?:Move|Trigg|Search|Arc|Spot|Paint|Disp|Cap|Laser)[A-Za-z]*)\s+(?=[\\\[\w*])",
    re.IGNORECASE | re.MULTILINE,
)
_NO_MOVES = ("triggio", "triggequip", "triggint", "triggstopproc", "triggspeed", "triggcheckio", "triggrampao")
_ASSIGNED = re.compile(r"(?:^|;)[ \t]*(\w+)(?:\{[^}]*\})?(?:\.\w+)*\s*:=", re.MULTILINE)
_DISPLACES = re.compile(
    r"(?:^|;)[ \t]*(?:(PDispOn|PDispSet)\b|PDispOff\b|(?:LOCAL[ \t]+)?PROC\b)", re.IGNORECASE | re.MULTILINE
)
_WORK_OBJECT = re.compile(r"\\WObj\s*:=\s*([\w{}.,]+)", re.IGNORECASE)
_KINDS = ("robtarget", "jointtarget", "tooldata", "wobjdata")
_PARTS = ("pos", "orient", "pose", "confdata", "extjoint", "robjoint", "loaddata", "num")
_NOT_CONNECTED = 8.9e9


def find(data: bytes, name: str) -> Found:
    """Return what stands in a RAPID module or backup file."""
    source = source_of(data, name)
    return _Module(source).found()


class _Module:
    def __init__(self, source: Source) -> None:
        self._source = source
        self._text = without_comments(source.text, "!")
        self._found = Found(source.name)
        self._parts: dict[str, Value] = {}
        self._displaced: dict[str, int] = {}

    def found(self) -> Found:
        """Return all that the module holds."""
        declarations = list(self._declarations())
        for _, kind, name, value in declarations:
            if kind in _PARTS:
                self._parts[name.lower()] = value
        for position, kind, name, value in declarations:
            if kind in _KINDS:
                array = re.match(r"\s*\{([^}]*)\}", self._text[self._text.find(name, position) + len(name) :])
                self._elements(kind, name, value, array[1].count(",") + 1 if array else 0, [])
        for found in _MOVE.finditer(self._text):
            self._move(found)
        self._mark_assigned()
        self._mark_displaced()
        return self._found

    def _declarations(self) -> Iterator[tuple[int, str, str, Value]]:
        for found in _DECLARED.finditer(self._text):
            kind, name = found[2].lower(), found[3]
            if kind not in _KINDS and kind not in _PARTS:
                continue
            line = self._source.line(found.start(1))
            if found[5] != ":=":
                if kind in _KINDS:
                    self._found.skip(
                        line, message("{found} {name}: no value in this file", found=found[2], name=name), name
                    )
                continue
            end = self._text.find(";", found.end())
            try:
                if end < 0:
                    raise ValueError(message("it has no end (;): {cut}", cut=CUT))
                yield found.start(1), kind, name, literal(self._text, found.end(), end)
            except ValueError as error:
                if kind in _KINDS:
                    self._found.skip(line, explained(f"{found[2]} {name}", error), name)

    def _elements(self, kind: str, name: str, value: Value, depth: int, index: list[int]) -> None:
        if depth and value.items is not None:
            for i, item in enumerate(value.items, start=1):
                self._elements(kind, name, item, depth - 1, [*index, i])
            return
        full = f"{name}{{{','.join(map(str, index))}}}" if index else name
        line = self._source.line(value.position)
        try:
            self._element(kind, full, value, line)
        except (ValueError, InputError) as error:
            self._found.skip(line, explained(f"{kind} {full}", error), full)

    def _element(self, kind: str, name: str, value: Value, line: int) -> None:
        file = self._source.name
        if kind == "robtarget":
            self._found.poses.append(self._robtarget(name, value, line))
        elif kind == "jointtarget":
            axes, external = self._list(value, 2)
            joints = tuple(self._numbers(axes, 6))
            self._found.poses.append(Taught(name, None, "abb", line, joints, self._external(external), file=file))
        elif kind == "tooldata":
            held, frame, _ = self._list(value, 3)
            moving = "" if self._boolean(held) else message("stands still beside the robot (robhold is FALSE)")
            self._found.tools.append(Frame(name, name, self._pose(frame), "abb", line, file, moving))
        else:
            held, programmed, mechanism, user, of_object = self._list(value, 5)
            moving = message("is held by the robot (robhold is TRUE)") if self._boolean(held) else ""
            if not self._boolean(programmed):
                moving = message(
                    "is moved by the mechanical unit {mechanism} (ufprog is FALSE)", mechanism=mechanism.text
                )
            pose = _chained(self._pose(user), self._pose(of_object))
            self._found.frames.append(Frame(name, name, pose, "abb", line, file, moving))

    def _robtarget(self, name: str, value: Value, line: int) -> Taught:
        position, rotation, configuration, external = self._list(value, 4)
        pose = (*self._numbers(position, 3), *self._numbers(rotation, 4))
        stands = None
        if configuration.items is not None or configuration.text.lower() in self._parts:
            stands = _configuration(self._numbers(configuration, 4))
        external_axes, file = self._external(external), self._source.name
        return Taught(name, pose, "abb", line, None, external_axes, file=file, configuration=stands)

    def _list(self, value: Value, count: int) -> tuple[Value, ...]:
        value = self._parts.get(value.text.lower(), value) if value.items is None else value
        if value.items is None:
            raise ValueError(message("'{value}' instead of a list of {count}", value=value.text[:40], count=count))
        if len(value.items) != count:
            raise ValueError(
                message("a list of {count} instead of {count_other}", count=len(value.items), count_other=count)
            )
        return value.items

    def _numbers(self, value: Value, count: int) -> list[float]:
        values: list[float] = []
        for item in self._list(value, count):
            item = self._parts.get(item.text.lower(), item) if item.items is None else item
            if item.items is not None:
                raise ValueError(message("a list where a number should stand"))
            values.append(number(item.text))
        return values

    def _pose(self, value: Value) -> tuple[float, ...]:
        position, rotation = self._list(value, 2)
        return (*self._numbers(position, 3), *self._numbers(rotation, 4))

    def _boolean(self, value: Value) -> bool:
        if value.text.strip().upper() not in ("TRUE", "FALSE"):
            raise ValueError(message("'{value}' instead of TRUE or FALSE", value=value.text.strip()[:40]))
        return value.text.strip().upper() == "TRUE"

    def _external(self, value: Value) -> dict[str, float] | None:
        if value.items is None and value.text.lower() not in self._parts:
            return None  # a name that this file does not define
        axes = dict(zip("abcdef", self._numbers(value, 6), strict=True))
        return {f"eax_{axis}": v for axis, v in axes.items() if abs(v) < _NOT_CONNECTED} or None

    def _move(self, found: re.Match[str]) -> None:
        """Note with which tool and work object a move uses its points; points that stand in it are taken."""
        kind = found[1].lower()
        line = self._source.line(found.start(1))
        end = unquoted(self._text, ";", found.end())
        if kind.startswith(_NO_MOVES) or end < 0:
            return
        arguments = split_top(self._text[found.end() : end])
        positional = [(p, a.strip()) for p, a in arguments if a.strip() and not a.strip().startswith("\\")]
        if len(positional) < 3:
            return
        points = positional[: 2 if re.match(r"(?:move|trigg|arc|search|cap|laser|paint|disp|spot)c", kind) else 1]
        tool: Reference = positional[-1][1].split("\\")[0].strip()
        if not re.fullmatch(r"[\w{}.,]+", str(tool)):
            self._found.skip(
                line, message("{found}: its tool '{tool}' is no name", found=found[1], tool=str(tool)[:40])
            )
            return
        work_object = _WORK_OBJECT.search(self._text[found.end() : end])
        frame: Reference = work_object[1] if work_object else "wobj0"
        for position, text in points:
            text = text.split("\\")[0].strip()
            if re.fullmatch(r"\w+(?:\{[\d,\s]+\})?", text):
                name = text.replace(" ", "")
                self._found.moves.setdefault(name.lower(), set()).add((tool, frame))
                self._found.want(name, line)
            elif text.startswith("["):
                self._inline(kind, text, found.end() + position, tool, frame)
            else:
                self._found.skip(line, explained(f"{found[1]} {text[:60]}", CALCULATED))

    def _inline(self, kind: str, text: str, position: int, tool: Reference, frame: Reference) -> None:
        position = self._text.index("[", position)
        line = self._source.line(position)
        try:
            value = literal(self._text, position, position + len(text))
            if kind == "moveabsj":
                self._element("jointtarget", f"line {line}", value, line)
                return
            taught = self._robtarget(f"line {line}", value, line)
        except (ValueError, InputError) as error:
            self._found.skip(line, message("position in the move: {error}", error=error))
            return
        self._found.poses.append(
            Taught(taught.name, taught.numbers, "abb", line, None, taught.external, tool, frame, self._source.name)
        )

    def _mark_assigned(self) -> None:
        """Say where the program changes a position, a tool or a work object: what stands here may not hold."""
        assigned = {
            found[1].lower(): self._source.line(found.start(1)) for found in _ASSIGNED.finditer(self._text)
        }
        for i, taught in enumerate(self._found.poses):
            line = assigned.get(taught.name.partition("{")[0].lower())
            if line is not None:
                self._found.poses[i] = replace(taught, doubt=changed(line))
        for said, entries in zip(_CHANGED, (self._found.tools, self._found.frames), strict=True):
            for i, entry in enumerate(entries):
                line = assigned.get(str(entry.number).partition("{")[0].lower())
                if line is not None:
                    entries[i] = replace(entry, doubt=message(said, number=entry.number, line=line))

    def _mark_displaced(self) -> None:
        """Say of positions that a program displaces (PDispSet, PDispOn) when it goes to them."""
        begun = [(found.start(), found[1] is not None) for found in _DISPLACES.finditer(self._text)]
        for found in _MOVE.finditer(self._text):
            before = [is_on for position, is_on in begun if position < found.start(1)]
            named = re.match(r"\s*(\w+)", self._text[found.end() :])
            if before and before[-1] and named:
                self._displaced.setdefault(named[1].lower(), self._source.line(found.start(1)))
        for i, taught in enumerate(self._found.poses):
            line = self._displaced.get(taught.name.partition("{")[0].lower())
            if line is not None:
                self._found.poses[i] = replace(taught, doubt=sentences([taught.doubt, shifted(line)]))


_CHANGED = templates((
    "The program changes the tool {number} (line {line}).",
    "The program changes the work object {number} (line {line}).",
))  # fmt: skip


def _chained(user: tuple[float, ...], of_object: tuple[float, ...]) -> tuple[float, ...]:
    identity = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    if of_object == identity:
        return user
    if user == identity:
        return of_object
    product = parse_pose("abb", user).matrix @ parse_pose("abb", of_object).matrix
    return tuple(to_pose("abb", RigidTransform(product, "base", "tool0")))


def _configuration(numbers: list[float]) -> Configuration | None:
    """Return how the arm stands by confdata: quadrants of axes 1, 4 and 6; wrist before axis 1, elbow, axis 5."""
    if any(value != int(value) for value in numbers) or not 0 <= numbers[3] <= 7:
        return None  # of another kind of arm
    of_axis_1, of_axis_4, of_axis_6, kind = map(int, numbers)
    quadrants = [((90.0 * cf, 90.0 * cf + 90.0),) for cf in (of_axis_1, of_axis_4, of_axis_6)]
    fifth = ((-180.0, 0.0),) if kind & 1 else ((0.0, 180.0),)
    ranges = (quadrants[0], ANYWHERE, ANYWHERE, quadrants[1], fifth, quadrants[2])
    return Configuration(ranges, not kind & 4, not kind & 2)
