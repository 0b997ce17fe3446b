"""FANUC: positions of .ls programs, and tool frames, user frames and position registers of .va files."""

import re
from dataclasses import replace

from calib_core.arms.configuration import ANYWHERE, Configuration
from calib_core.formats.shared.number import NUMBER, number
from calib_core.messages import explained, message, sentences
from calib_core.robots.controller_file import Found, Frame, Taught
from calib_core.robots.phrases import CUT, CUT_LINE, TWICE
from calib_core.robots.phrases import shifted as move_adds
from calib_core.robots.text import Source, source_of

_POSITION = re.compile(r'^[ \t]*P\[\s*(\d+)\s*(?::\s*"?([^"\]]*)"?)?\s*\]\s*\{', re.MULTILINE)
_GROUP = re.compile(r"\bGP(\d+)\s*:", re.IGNORECASE)
_FRAMES = re.compile(r"\bUF\s*:\s*(\w+)\s*,\s*UT\s*:\s*(\w+)", re.IGNORECASE)
_FIELD = re.compile(r"\b([A-Z]\d?)\s*=\s*([^\s,]+)\s*([A-Za-z]*)")
_VARIABLE = re.compile(r"^\[\*(\w+)\*\](\$?\w+)[^\n]*$", re.MULTILINE)
_ENTRY = re.compile(r"^[ \t]*\[\s*(\d+)\s*,\s*(\d+)\s*\]\s*=[ \t]*(?:'([^']*)')?", re.MULTILINE)
_COMPONENT = re.compile(r"\b(J\d|[XYZWPRE]\d?)\s*[:=]\s*([^\s,]+)(?:\s*(mm|[cmu]?m|in(?:ch(?:es)?)?|deg|rad)\b)?")
_SETS = re.compile(
    r"^[ \t]*\d+:\s*(?:PR\[(\d+)[^\],]*\]\s*=\s*[LJ]POS|PR\[(\d+)[^\],]*,\s*([1-6])\]\s*=\s*(\(?"
    + NUMBER
    + r"\)?)\s*;|(UTOOL|UFRAME)\[(\d+)[^\]]*\]\s*=\s*(?:PR\[(\d+)[^\],]*\]\s*;)?)",
    re.MULTILINE,
)
_CHANGED = re.compile(r"^[ \t]*\d*[ \t]*:[ \t]*(P\[\d+)[^\]]*\]\s*=", re.MULTILINE)
_MOVE = re.compile(r"^[ \t]*\d*[ \t]*:[ \t]*[JLCA][ \t]+(PR?\[[^\n]*)", re.MULTILINE)
_OFFSET = re.compile(r"\b(?:[A-Z]+_)?V?(?:OFFSET|VERSATZ)\b", re.IGNORECASE)
_NAMES = ("X", "Y", "Z", "W", "P", "R")
_UNITS = {**dict.fromkeys("XYZ", ("mm",)), **dict.fromkeys("WPR", ("deg",))}


def find(data: bytes, name: str) -> Found:
    """Return what stands in a listing of a program or of variables."""
    source = source_of(data, name)
    found = Found(name)
    _program(source, found)
    _variables(source, found)
    return found


def _program(source: Source, found: Found) -> None:
    section = re.search(r"^[ \t]*/POS\b", source.text, re.MULTILINE)
    begin = section.end() if section else 0
    _assigned(source, begin if section else len(source.text), found)
    for change in _CHANGED.finditer(source.text, 0, begin):
        found.change("point", f"{change[1]}]", source.line(change.start(1)))
    incremental = _incremental(source.text[:begin])
    end = begin if section else 0
    shifted = _moves(source, end, found)
    remote, together = (_with(word, source, end) for word in ("RTCP", "COORD"))
    positions = list(_POSITION.finditer(source.text, begin))
    for i, position in enumerate(positions):
        line = source.line(position.start(1))
        until = positions[i + 1].start() if i + 1 < len(positions) else len(source.text)
        end = source.text.find("}", position.end(), until)
        name = f"P[{position[1]}]"
        try:
            if end < 0:
                raise ValueError(message("it has no end (}}): {cut}", cut=CUT))
            body = source.text[position.end() : end]
            taught = _position(name, body, line, source.name, found)
            if int(position[1]) in incremental:
                raise ValueError(message("an incremental move (INC) uses it: it is no place"))
            if name in remote:
                raise ValueError(
                    message(
                        "a move with a remote TCP uses it (line {line}): the tool stands still", line=remote[name]
                    )
                )
            if name in together:
                doubt = message(
                    "It moves with another group (COORD, line {line}): make sure that it is in the base.",
                    line=together[name],
                )
                taught = replace(taught, doubt=doubt)
            if name in shifted:
                taught = replace(taught, doubt=sentences([taught.doubt, move_adds(shifted[name])]))
            found.poses.append(taught)
        except ValueError as error:
            found.skip(line, explained(f"{name}", error), name)


def _assigned(source: Source, end: int, found: Found) -> None:
    """Take frames that the program sets: ``PR[9,1]=…`` to ``PR[9,6]=…``, then ``UTOOL[1]=PR[9]``."""
    registers: dict[str, dict[int, float]] = {}
    for step in _SETS.finditer(source.text, 0, end):
        if step[1]:
            registers[step[1]] = {}
        elif step[2]:
            registers.setdefault(step[2], {})[int(step[3])] = float(step[4].strip("()"))
        else:
            line, values = source.line(step.start(5)), registers.get(step[7] or "", {})
            if step[7] is None:
                found.change("tool" if step[5].upper() == "UTOOL" else "frame", step[6], line)
                continue
            if set(values) != set(range(1, 7)):
                found.skip(
                    line,
                    message(
                        "{step}[{step_other}]: PR[{step_2}] has no six numbers in the program",
                        step=step[5],
                        step_other=step[6],
                        step_2=step[7],
                    ),
                )
                found.change("tool" if step[5].upper() == "UTOOL" else "frame", step[6], line)
                continue
            pose = tuple(values[i] for i in range(1, 7))
            frame = Frame(int(step[6]), None, pose, "fanuc", line, source.name, by_program=True)
            (found.tools if step[5].upper() == "UTOOL" else found.frames).append(frame)


def _moves(source: Source, end: int, found: Found) -> dict[str, int]:
    """Note where moves go; return the positions to which a move adds an offset, with its line."""
    shifted: dict[str, int] = {}
    for move in _MOVE.finditer(source.text, 0, end):
        line = source.line(move.start(1))
        for kind, index in re.findall(r"\b(PR?)\[\s*(\d+)[^\]]*\]", _OFFSET.split(move[1])[0]):
            found.want(f"{kind}[{index}]", line)
            if _OFFSET.search(move[1]):
                shifted.setdefault(f"{kind}[{index}]", line)
    return shifted


def _with(word: str, source: Source, end: int) -> dict[str, int]:
    """Return the positions of moves that a word stands behind, with its line."""
    return {
        f"{kind}[{index}]": source.line(move.start(1))
        for move in _MOVE.finditer(source.text, 0, end)
        if re.search(rf"\b{word}\b", move[1])
        for kind, index in re.findall(r"\b(PR?)\[\s*(\d+)[^\]]*\]", move[1])
    }


def _incremental(program: str) -> set[int]:
    moves = re.findall(r"^[ \t]*\d*:?[ \t]*[JLCA][ \t]+P\[\s*(\d+)[^\]]*\][^;]*\bINC\b", program, re.MULTILINE)
    return {int(index) for index in moves}


def _position(name: str, body: str, line: int, file: str, found: Found) -> Taught:
    """Return a position of group 1, with the other groups' axes as external ones."""
    groups = list(_GROUP.finditer(body))
    if not groups:
        raise ValueError(message("it has no motion group (GP1)"))
    external: dict[str, float] = {}
    robot: tuple[dict[str, float], str] | None = None
    for i, group in enumerate(groups):
        text = body[group.end() : groups[i + 1].start() if i + 1 < len(groups) else len(body)]
        fields = _fields(text)
        if group[1] == "1":
            if robot:
                raise ValueError(message("group 1: {twice}", twice=TWICE))
            robot = fields, text
        elif "X" in fields:
            found.skip(line, message("{name}: group {group} is another robot's pose", name=name, group=group[1]))
        else:
            external |= {f"GP{group[1]}.{axis}": value for axis, value in fields.items()}
    if robot is None:
        raise ValueError(message("it has no motion group 1: it is not this robot's"))
    fields, text = robot
    frames = _FRAMES.search(text)
    if not frames:
        raise ValueError(message("it names no user frame and tool (UF, UT)"))
    base, tool = (int(v) if v.isdigit() else None for v in frames.groups())
    external = {axis: v for axis, v in fields.items() if axis[0] == "E"} | external
    joints = tuple(fields[f"J{i}"] for i in range(1, 10) if f"J{i}" in fields)
    if joints:
        return Taught(name, None, "fanuc", line, joints, external or None, tool, base, file)
    stands = _configuration(text)
    return Taught(
        name, _pose(fields), "fanuc", line, None, external or None, tool, base, file, configuration=stands
    )


def _configuration(text: str) -> Configuration | None:
    """Return how the arm stands by ``N U T, 0, 0, 0``: wrist, elbow, side, and turns of joints 1, 4 and 6.

    N is a fifth joint below zero; a turn of t is an angle from 360 t − 180 to 360 t + 180.
    """
    told = re.search(r"[CK]ONFIG\s*:\s*'?\s*([NF])\s+([UD])\s+([TB])\s*,([-\d,\s]*)", text, re.IGNORECASE)
    turns = [int(turn) for turn in re.findall(r"-?\d+", told[4])] if told else []
    if told is None or len(turns) != 3:
        return None
    first, fourth, sixth = (((360.0 * turn - 180.0, 360.0 * turn + 180.0),) for turn in turns)
    fifth = ((-180.0, 0.0),) if told[1].upper() == "N" else ((0.0, 180.0),)
    ranges = (first, ANYWHERE, ANYWHERE, fourth, fifth, sixth)
    return Configuration(ranges, told[3].upper() == "T", told[2].upper() == "U")


def _fields(text: str) -> dict[str, float]:
    """Return the values of a group by their names, in mm and degrees."""
    text = re.sub(r"K?C?ONFIG\s*:\s*'[^']*'", " ", text, flags=re.IGNORECASE)
    fields: dict[str, float] = {}
    for axis, value, unit in _FIELD.findall(text):
        if axis in fields:
            raise ValueError(f"{axis}: {TWICE}")
        if value.startswith("*"):
            raise ValueError(message("it is not taught (********)"))
        fields[axis] = number(value)
        if unit not in _UNITS.get(axis, ("mm", "deg")):
            allowed = list(_UNITS.get(axis, ("mm", "deg")))
            raise ValueError(
                message("{axis} is in '{unit}' instead of {allowed:or}", axis=axis, unit=unit, allowed=allowed)
                if unit
                else message("{axis} has no unit", axis=axis)
            )
    left = re.sub(r"[\s,]+", "", _FRAMES.sub("", _FIELD.sub("", text)))
    if re.match(r"R[XYZWPR]=", left):
        raise ValueError(
            message("a remote TCP (RX, RY …): the tool stands still and the robot holds the workpiece")
        )
    if left:
        raise ValueError(message("'{left}' cannot be read", left=left[:40]))
    return fields


def _pose(fields: dict[str, float]) -> tuple[float, ...]:
    missing = [name for name in _NAMES if name not in fields]
    if missing:
        raise ValueError(message("{name} missing", name=", ".join(missing)))
    return tuple(fields[name] for name in _NAMES)


def _variables(source: Source, found: Found) -> None:
    heads = list(_VARIABLE.finditer(source.text))
    for i, head in enumerate(heads):
        what = head[2].upper()
        if what not in ("$MNUTOOL", "$MNUFRAME", "$POSREG"):
            continue
        until = heads[i + 1].start() if i + 1 < len(heads) else len(source.text)
        entries = list(_ENTRY.finditer(source.text, head.end(), until))
        for k, entry in enumerate(entries):
            end = entries[k + 1].start() if k + 1 < len(entries) else until
            _entry(what, entry, source.text[entry.end() : end], source, found)


def _entry(what: str, entry: re.Match[str], body: str, source: Source, found: Found) -> None:
    line = source.line(entry.start(1))
    group, index, comment = int(entry[1]), int(entry[2]), (entry[3] or "").strip()
    label = {"$MNUTOOL": "tool", "$MNUFRAME": "user frame", "$POSREG": "PR"}[what]
    try:
        if re.search(r"Uninitialized|\*{4,}", body, re.IGNORECASE):
            raise ValueError(message("it is not set (Uninitialized)"))
        if source.text.endswith(body) and not body.endswith("\n"):
            raise ValueError(CUT_LINE)
        stated = re.search(r"Group\s*:\s*(\d+)", body, re.IGNORECASE)
        if stated and int(stated[1]) != group:
            raise ValueError(
                message("its group is {stated}, but its index says {group}", stated=stated[1], group=group)
            )
        fields = _components(body)
        if what == "$POSREG":
            if group == 1:
                found.poses.append(_register(index, fields, line, source.name, _configuration(body)))
            return
        frame = Frame(index, comment or None, _pose(fields), "fanuc", line, source.name, group=group)
        (found.tools if what == "$MNUTOOL" else found.frames).append(frame)
    except ValueError as error:
        found.skip(
            line,
            f"{label} {index}{f' of group {group}' if group > 1 else ''}: {error}",
            f"PR[{index}]" if what == "$POSREG" else "",
        )


def _register(index: int, fields: dict[str, float], line: int, file: str, stands: Configuration | None) -> Taught:
    joints = tuple(fields[f"J{i}"] for i in range(1, 10) if f"J{i}" in fields)
    external = {axis: v for axis, v in fields.items() if axis[0] == "E"} or None
    pose = None if joints else _pose(fields)
    return Taught(f"PR[{index}]", pose, "fanuc", line, joints or None, external, file=file, configuration=stands)


def _components(body: str) -> dict[str, float]:
    text = re.sub(r"Group\s*:\s*\d+", " ", body, flags=re.IGNORECASE)
    text = re.sub(r"Config\s*:[^\nX]*", " ", text, flags=re.IGNORECASE)
    fields: dict[str, float] = {}
    for axis, value, unit in _COMPONENT.findall(text):
        if axis in fields:
            raise ValueError(f"{axis}: {TWICE}")
        fields[axis] = number(value)
        if unit and unit not in _UNITS.get(axis, ("mm", "deg")):
            raise ValueError(message("{axis} is in '{unit}'", axis=axis, unit=unit))
    left = re.sub(rf"[\s,]+|{NUMBER}(?=\s*$)", "", _COMPONENT.sub("", text))
    if left and "X" not in fields and not any(axis[0] == "J" for axis in fields):
        raise ValueError(message("'{left}' cannot be read", left=left[:40]))
    return fields
