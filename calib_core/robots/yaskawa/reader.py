"""Yaskawa: jobs (JBI), TOOL.CND and UFRAME.CND.

A job's positions are pulses or poses, by the `///POSTYPE` before them; one job may hold both. Pulses become joints
by the parameters of the same backup (`pulses`).
"""

import re
from dataclasses import replace
from typing import NamedTuple

from calib_core.arms.configuration import ANYWHERE, Configuration, Range
from calib_core.messages import explained, message
from calib_core.robots.controller_file import Found, Frame, Taught
from calib_core.robots.phrases import CUT, TWICE, changed, require_count, shifted
from calib_core.robots.text import Source, numbers, source_of
from calib_core.robots.yaskawa.pulses import Pulses, per_degree_of

_ROW = re.compile(r"^(C|P|BC|EC|BP|EX)(\d{3,5})\s*=(.*)$")
_IN_BASE = ("BASE", "ROBOT")


def find(data: bytes, name: str) -> Found:
    """Return what stands in a job, a condition file or the parameters."""
    source = source_of(data, name)
    found = Pulses(name, per_degree=per_degree_of(source.text))
    if group := re.search(r"^///GROUP1\s+RB(\d)", source.text, re.MULTILINE):
        found.group = int(group[1])
    if re.search(r"^//TOOL\b", source.text, re.MULTILINE):
        _tools(source, found)
    if re.search(r"^//UFRAME\b", source.text, re.MULTILINE):
        _frames(source, found)
    if re.search(r"^(?:/JOB|//POS|///POSTYPE)\b", source.text, re.MULTILINE):
        _job(source, found)
    return found


def _tools(source: Source, found: Found) -> None:
    """Read TOOL.CND: a number, a name, the frame, then load data."""
    index, name, awaited, head = -1, "", False, 0
    for line, content in [*source.lines(), (0, "//TOOL")]:
        text = content.strip()
        if re.match(r"//[A-Z]", text):
            if awaited:
                found.skip(head, message("tool {index}: its frame is missing: {cut}", index=index, cut=CUT))
            begin = re.fullmatch(r"//TOOL\s+(\d+)", text)
            awaited = begin is not None
            index, name, head = int(begin[1]) if begin else -1, "", line
            if not begin and line and text.startswith("//TOOL"):
                found.skip(line, message("'{text}' names no tool", text=text[:40]))
        elif text.startswith("///NAME") and index >= 0:
            name = text.removeprefix("///NAME").strip()
        elif awaited and text and not text.startswith("/"):
            awaited = False
            try:
                source.require_ended(line)
                frame = Frame(index, name or None, numbers(text, 6), "yaskawa", line, source.name)
                found.tools.append(frame)
            except ValueError as error:
                found.skip(line, message("tool {index}: {error}", index=index, error=error))


def _frames(source: Source, found: Found) -> None:
    index, name, known = -1, "", False
    for line, content in source.lines():
        text = content.strip()
        if begin := re.fullmatch(r"//UFRAME\s+(\d+)", text):
            index, name, known = int(begin[1]), "", False
        elif text.startswith("///NAME"):
            name = text.removeprefix("///NAME").strip()
        elif text.startswith("////BUSER"):
            try:
                source.require_ended(line)
                if index < 0:
                    raise ValueError(message("it stands under no //UFRAME"))
                if known:
                    raise ValueError(TWICE)
                pose = numbers(text.removeprefix("////BUSER").lstrip(" ="), 6)
                found.frames.append(Frame(index, name or None, pose, "yaskawa", line, source.name))
                known = True
            except ValueError as error:
                found.skip(line, message("user frame {index}: {error}", index=index, error=error))


_STEP = re.compile(r"(?:COMM\s+)?([A-Z]+)\b(.*)")
_NAMED = re.compile(r"(?<![A-Z0-9])([PC])(\d{3,5})\b")
_CHANGES = ("ADD", "SUB", "SET", "SETE", "GETS", "GETPOS", "MULMAT", "INVMAT", "CNVRT", "MFRAME")


class _Uses(NamedTuple):
    """What a job's instructions do with its positions, by `_key` of their names: a line each."""

    moved: dict[str, int]
    changed: dict[str, int]
    shifts: dict[str, int]
    shifted: dict[str, int]
    under_shift: list[int]

    def note(self, text: str, line: int) -> None:
        """Note what one instruction says."""
        step = _STEP.match(text)
        if step is None or text.startswith("COMM"):
            return
        names = [_key(kind + number) for kind, number in _NAMED.findall(step[2])]
        if step[1].startswith(("MOV", "SMOV")):
            for name in names:
                self.moved.setdefault(name, line)
                if self.under_shift:
                    self.shifted.setdefault(name, line)
        elif step[1] in ("SFTON", "MSHIFT", "IMOV", "EIMOV"):
            self.shifts.update(dict.fromkeys(names, line))
            if step[1] == "SFTON":
                self.under_shift.append(line)
        elif step[1] == "SFTOF":
            self.under_shift.clear()
        elif step[1] in _CHANGES and names:
            self.changed.setdefault(names[0], line)
            if step[1] in ("ADD", "SUB"):
                self.shifts.update(dict.fromkeys(names[1:], line))

    def require_a_place(self, name: str) -> None:
        """Raise ValueError for a position that the job only uses to shift others."""
        key = _key(name)
        if key in self.shifts and key not in self.moved:
            raise ValueError(
                message("the job uses it as a shift (line {shifts}): it is no place", shifts=self.shifts[key])
            )


def _key(name: str) -> str:
    """Return a position's name with five digits, as lists write it; instructions write three."""
    return name[0] + name[1:].zfill(5)


class _State:
    def __init__(self) -> None:
        self.kind, self.tool, self.user = "", None, None
        self.tool: int | None
        self.user: int | None
        self.stands: Configuration | None = None


def _configuration(text: str) -> Configuration | None:
    """Return how the arm stands by ///RCONF: flip, elbow, side, and whether R, T and S are beyond half a turn."""
    told = [one.strip() for one in text.split(",")[:6]]
    if len(told) < 6 or not set(told) <= {"0", "1"}:
        return None
    no_flip, lower, rear, *beyond = (one == "1" for one in told)
    # Flip: the fourth joint within 90° of zero or of a whole turn.
    within: tuple[Range, ...] = ((90.0, 180.0), (-180.0, -90.0)) if no_flip else ((-90.0, 90.0),)
    further: tuple[Range, ...] = (
        ((180.0, 270.0), (-270.0, -180.0)) if no_flip else ((270.0, 360.0), (-360.0, -270.0))
    )
    whole: tuple[Range, ...] = ((180.0, 360.0), (-360.0, -180.0))
    sixth, first = (whole if far else ANYWHERE for far in beyond[1:])
    ranges = (first, ANYWHERE, ANYWHERE, further if beyond[0] else within, ANYWHERE, sixth)
    return Configuration(ranges, not rear, not lower)


def _job(source: Source, found: Pulses) -> None:
    state = _State()
    external: dict[str, dict[str, float]] = {}
    heads: dict[str, int] = {}
    rows: list[tuple[int, str, str, str, int | None, int | None, Configuration | None]] = []
    uses = _Uses({}, {}, {}, {}, [])
    in_program = False
    for line, content in source.lines():
        text = content.strip()
        in_program = in_program or text.startswith("//INST")
        if in_program:
            uses.note(text, line)
            continue
        if tagged := re.match(r"///(POSTYPE|TOOL|USER|RCONF)\s+(\S.*)", text):
            value = tagged[2].split()[0].split(",")[0]
            if tagged[1] == "RCONF":
                state.stands = _configuration(tagged[2])
            elif tagged[1] == "POSTYPE":
                state.kind = value.upper()
            elif tagged[1] == "TOOL":
                state.tool = int(value) if value.isdigit() else None
            else:
                state.user = int(value) if value.isdigit() else None
        elif row := _ROW.match(text):
            if row[1] in ("BC", "EC", "BP", "EX"):
                _external(external, row, line, found)
                heads.setdefault(row[2], line)
            else:
                so = state.kind, state.tool, state.user, state.stands
                rows.append((line, row[1] + row[2], row[3].strip(), *so))
        elif re.match(r"[A-Z]+\d+\s*=", text):
            found.skip(line, message("'{text}' is no row of a position", text=text[:40]))
    rail = any(axis.startswith("BC") for axes in external.values() for axis in axes)
    for line, name, values, kind, tool, user, stands in rows:
        try:
            source.require_ended(line)
            taught = _position(name, values, kind, tool, user, line, source.name)
            uses.require_a_place(name)
        except ValueError as error:
            found.skip(line, explained(f"{name}", error), name)
            continue
        axes = {**(taught.external or {}), **external.get(name[1:], {})} or None
        doubts = ["The robot stands on a rail: make sure that its base did not move."] if rail else []
        if line_of := uses.changed.get(_key(name)):
            doubts.append(changed(line_of))
        if line_of := uses.shifted.get(_key(name)):
            doubts.append(shifted(line_of))
        taught = replace(taught, external=axes, doubt=" ".join(doubts), configuration=stands)
        (found.pulses if kind == "PULSE" else found.poses).append(taught)
    for number in external.keys() - {row[1][1:] for row in rows}:
        found.skip(
            heads[number], message("position {number}: external axes alone, no pose of the robot", number=number)
        )
    written = {_key(row[1]): row[1] for row in rows}
    for key, line in uses.moved.items():
        found.want(written.get(key, key), line)


def _external(external: dict[str, dict[str, float]], row: re.Match[str], line: int, found: Found) -> None:
    try:
        values = numbers(row[3])
    except ValueError as error:
        found.skip(line, explained(f"{row[1]}{row[2]}", error))
        return
    named = {f"{row[1]}{i}": value for i, value in enumerate(values, start=1)}
    external.setdefault(row[2], {}).update(named)


def _position(name: str, text: str, kind: str, tool: int | None, user: int | None, line: int, file: str) -> Taught:
    if not kind:
        raise ValueError(message("no ///POSTYPE says what its numbers are"))
    values = numbers(text)
    if kind in ("ANGLE", "PULSE"):
        return Taught(name, None, "yaskawa", line, values, None, tool, file=file)
    require_count(values, 6, 7)
    if kind == "USER":
        if user is None:
            raise ValueError(message("it is in a user frame, but no ///USER says which"))
        frame: int | str = user
    elif kind in _IN_BASE:
        frame = kind.lower()
    else:
        raise ValueError(message("positions of type {kind} are not in the robot's base", kind=kind))
    external = {"E": values[6]} if len(values) == 7 else None
    return Taught(name, values[:6], "yaskawa", line, None, external, tool, frame, file)
