"""Universal Robots: script poses, .urp programs, installations and recorded RTDE rows.

A script's poses are in the robot's base, of the TCP that `set_tcp` has set last.
"""

import csv
import io
import math
import re
from dataclasses import replace

from calib_core.formats.shared.number import number
from calib_core.formats.shared.xml_file import is_gzip, unzipped
from calib_core.messages import explained, message
from calib_core.robots.controller_file import Found, Frame, Reference, Taught
from calib_core.robots.phrases import UNMATCHED, changed, require_count
from calib_core.robots.text import Source, closing, numbers, source_of, split_top, without_comments
from calib_core.robots.ur.packed import found_in, scripts_in
from calib_core.robots.ur.values import degrees, plausible

_LITERAL = re.compile(r"(?:(\w+)\s*(=|\()\s*)?(?<![\w])p\s*(?=\[)")
_JOINTS = re.compile(r"^[ \t]*(?:global\s+|local\s+)?(\w+)\s*=\s*(?=\[)", re.MULTILINE)
_LABEL = re.compile(r"^[ \t]*\$[^\n]*", re.MULTILINE)  # what the pendant shows for the next lines
_ASSIGNED = re.compile(
    r"^[ \t]*(?:global\s+|local\s+)?(\w+)[ \t]*(?:\[[^\]\n]*\][ \t]*=|=(?![ \t]*p?[ \t]*\[))(?!=)", re.MULTILINE
)
_CALL = re.compile(
    r"\b(set_tcp|move[jlpc]|servoj|servoc|get_inverse_kin)\s*\(\s*(?:get_inverse_kin\s*\(\s*)?(\w+)\s*[,)]"
)
_CALCULATED = re.compile(r"\b(pose_\w+|interpolate_pose)\s*\(([^()\n]*)")
_MOVES = ("movej", "movel", "movep", "movec", "servoj", "servoc", "servol", "get_inverse_kin")


def find(data: bytes, name: str) -> Found:
    """Return what stands in a script, a program, an installation or a recording."""
    plain = unzipped(data, name)
    if is_gzip(data) or plain.lstrip()[:1] == b"<":
        return _xml(plain, name)
    source = source_of(plain, name)
    first = source.text.lstrip().split("\n", 1)[0]
    if "actual_TCP_pose_0" in first or "actual_q_0" in first:
        return _recording(source)
    return _Script(source).found()


class _Script:
    def __init__(self, source: Source) -> None:
        self._source = source
        text = without_comments(source.text, "#")
        self._text = _LABEL.sub(lambda label: " " * len(label[0]), text)
        self._moved = {m[2].lower() for m in _CALL.finditer(self._text) if m[1] != "set_tcp"}
        self._found = Found(source.name)
        self._named: dict[str, tuple[float, ...]] = {}
        self._tool: Reference | None = None

    def found(self) -> Found:
        """Return all that the script holds, followed from its beginning to its end."""
        steps = [(m.start(), "literal", m) for m in _LITERAL.finditer(self._text)]
        steps += [(m.start(), "call", m) for m in _CALL.finditer(self._text)]
        steps += [(m.start(1), "joints", m) for m in _JOINTS.finditer(self._text)]
        for _, kind, match in sorted(steps, key=lambda step: step[0]):
            {"literal": self._literal, "call": self._call, "joints": self._joints}[kind](match)
        self._mark_assigned()
        self._leave_out_calculated()
        return self._found

    def _leave_out_calculated(self) -> None:
        """Leave out variables that only enter calculations: they are in a frame of their own, or are one."""
        calls = {n.lower(): m for m in _CALCULATED.finditer(self._text) for n in re.findall(r"\w+", m[2])}
        for taught in [p for p in self._found.poses if p.name.lower() in calls.keys() - self._moved]:
            what = f"{calls[taught.name.lower()][1]}({taught.name})"
            self._found.poses.remove(taught)
            self._found.skip(
                taught.line,
                message("{what}: a pose in a calculation is no place of the robot", what=what),
                taught.name,
            )

    def _mark_assigned(self) -> None:
        """Say where the script changes a variable, so that its value here may not be the one moved to."""
        lines = {m[1]: self._source.line(m.start(1)) for m in _ASSIGNED.finditer(self._text)}
        for i, taught in enumerate(self._found.poses):
            if taught.name in lines:
                self._found.poses[i] = replace(taught, doubt=changed(lines[taught.name]))

    def _literal(self, match: re.Match[str]) -> None:
        position = match.end()
        line = self._source.line(position)
        before, sign = match[1], match[2]
        name = before if sign == "=" else f"line {line}"
        try:
            end = closing(self._text, position, "\n")
            if end < 0:
                raise ValueError(UNMATCHED)
            pose = _pose(self._text[position + 1 : end - 1])
        except ValueError as error:
            self._found.skip(line, explained(f"{name}", error), name)
            return
        if sign == "(" and before == "set_tcp":
            self._set_tcp(message("set_tcp of line {line}", line=line), pose, line)
        elif sign == "=":
            self._named[before.lower()] = pose
            self._found.poses.append(Taught(name, pose, "ur", line, frame="base", file=self._source.name))
        elif sign == "(" and before in _MOVES:
            taught = Taught(name, pose, "ur", line, None, None, self._tool, "base", self._source.name)
            self._found.poses.append(taught)
        elif self._inside_of("movec", match.start()):
            taught = Taught(f"{name} (2)", pose, "ur", line, None, None, self._tool, "base", self._source.name)
            self._found.poses.append(taught)
        else:
            what = f"{before}(p[…])" if sign == "(" else "p[…]"
            self._found.skip(line, message("{what}: a pose in a calculation is no place of the robot", what=what))

    def _inside_of(self, call: str, position: int) -> bool:
        begin = self._text.rfind("\n", 0, position) + 1
        return re.match(rf"\s*{call}\s*\(\s*(?:p\[[^\]]*\]|\w+)\s*,\s*$", self._text[begin:position]) is not None

    def _call(self, match: re.Match[str]) -> None:
        called, name = match[1], match[2]
        line = self._source.line(match.start())
        if called != "set_tcp":
            if name != "p":
                self._found.want(name, line)
            if name.lower() in self._named and self._tool is not None:
                self._found.moves.setdefault(name.lower(), set()).add((self._tool, "base"))
        elif name.lower() in self._named:
            self._set_tcp(name, self._named[name.lower()], line)
            self._found.poses = [p for p in self._found.poses if p.name != name]
        elif name != "p":
            self._tool = f"{name} (line {line})"

    def _set_tcp(self, name: str, pose: tuple[float, ...], line: int) -> None:
        self._found.tools.append(Frame(name, name, pose, "ur", line, self._source.name))
        self._tool = name

    def _joints(self, match: re.Match[str]) -> None:
        if not match[1].endswith("_q") and match[1].lower() not in self._moved:
            return
        line = self._source.line(match.start(1))
        end = closing(self._text, match.end(), "\n")
        try:
            if end < 0:
                raise ValueError(UNMATCHED)
            joints = degrees(numbers(self._text[match.end() + 1 : end - 1], 6))
        except ValueError as error:
            self._found.skip(line, explained(f"{match[1]}", error), match[1])
            return
        of = match[1].removesuffix("_q") + "_p"
        for i, taught in enumerate(self._found.poses):
            if taught.name == of:
                self._found.poses[i] = replace(taught, joints_deg=joints)
                self._found.unread.add(match[1].lower())
                return
        self._found.poses.append(Taught(match[1], None, "ur", line, joints, file=self._source.name))


def _pose(text: str) -> tuple[float, ...]:
    parts = [part for _, part in split_top(text)]
    require_count(parts, 6)
    return plausible(tuple(_radians(part) for part in parts))


def _radians(text: str) -> float:
    """Return a number, or the radians of ``d2r(…)``."""
    in_degrees = re.fullmatch(r"\s*d2r\s*\(([^()]*)\)\s*", text)
    return math.radians(number(in_degrees[1])) if in_degrees else number(text)


def _xml(data: bytes, name: str) -> Found:
    """Return what stands in a program or an installation, and in the scripts that a program keeps copies of."""
    found = found_in(data, name)
    for text, line in scripts_in(data, name):
        part = _Script(source_of(text.encode(), name)).found()
        for own, more in ((found.poses, part.poses), (found.tools, part.tools), (found.skipped, part.skipped)):
            own.extend(replace(one, line=one.line + line - 1) for one in more)  # type: ignore[misc, type-var]
        found.moves.update(part.moves)
        found.wanted.update({key: (wanted, at + line - 1) for key, (wanted, at) in part.wanted.items()})
        found.unread |= part.unread
    return found


def _recording(source: Source) -> Found:
    """Return the rows of an RTDE recording: poses of the TCP, with joints where they were recorded."""
    found = Found(source.name)
    head, _, _ = source.text.partition("\n")
    separator = max(",; \t", key=head.count)
    rows = csv.DictReader(io.StringIO(source.text), delimiter=separator, skipinitialspace=True)
    for row in rows:
        line = rows.line_num
        name = message("row {line}", line=line)
        try:
            source.require_ended(line)
            joints = _group(row, "actual_q")
            offset = _group(row, "tcp_offset")
            pose = _group(row, "actual_TCP_pose")
            tool = None
            if offset is not None:
                tool = "tcp_offset " + " ".join(f"{v:g}" for v in offset)
                if all(t.number != tool for t in found.tools):
                    found.tools.append(Frame(tool, "tcp_offset", plausible(offset), "ur", line, source.name))
            turned = None if joints is None else degrees(joints)
            taught = Taught(name, pose and plausible(pose), "ur", line, turned, None, tool, "base", source.name)
            found.poses.append(taught)
        except ValueError as error:
            found.skip(line, explained(f"{name}", error))
    return found


def _group(row: dict[str, str | None], name: str) -> tuple[float, ...] | None:
    if f"{name}_0" not in row:
        return None
    return tuple(number(row.get(f"{name}_{i}") or "") for i in range(6))
