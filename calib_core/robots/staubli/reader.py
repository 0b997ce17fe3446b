"""Stäubli VAL 3: tools, frames, points and joints of .dtx data, and the moves of .pgx programs.

Tools stand in another tool or in the flange, points and frames in another frame or in the world, by `fatherId`;
an attribute that is left out is 0.  Version 6 of VAL 3 writes the same in elements of its own: a `<point>` with
its father, and a value for each index.  The unit stands in the project file (.pjx): see `units.py`.
"""

import re
from dataclasses import dataclass

from calib_core.errors import InputError
from calib_core.formats.shared.number import number
from calib_core.formats.shared.xml_file import Element, elements
from calib_core.frames import RigidTransform
from calib_core.messages import explained, message
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.robots.controller_file import Found, Frame, Taught
from calib_core.robots.staubli.units import unit_of

_NAMES = ("x", "y", "z", "rx", "ry", "rz")
_MOVE = re.compile(r"\bmove[jlc]\s*\(([^()]*)\)", re.IGNORECASE)
_VALUES = {"valueFrame": "tfValue", "valueTool": "ttValue", "valuePoint": "tpValue", "valueJoint": "jointValue"}
"""Of version 6: what holds a value of an index, and the element in it with the numbers."""
_ROOTS = {"", "flange", "flange[0]", "world", "world[0]"}


@dataclass(frozen=True)
class _Entry:
    kind: str
    name: str
    pose: tuple[float, ...]
    father: str
    line: int


def find(data: bytes, name: str) -> Found:
    """Return what stands in a .dtx or .pgx file."""
    found = Found(name)
    entries: list[_Entry] = []
    values: list[Element] = []
    fathers: dict[int, str] = {}
    for element in elements(data, name):
        if element.name == "Value" and element.path and element.path[-1].name == "Data":
            _value(element, element.path[-1], entries, found)
        elif len(element.path) > 1 and _VALUES.get(element.path[-1].name) == element.name:
            fathers.setdefault(element.path[-2].start, "")
            values.append(element)
        elif element.name in ("fFather", "tFather", "pFather") and element.path:
            named = element.attributes
            father = f"{named.get('name', '')}[{named.get('fatherIndex', '0')}]" if named.get("name") else ""
            fathers[element.path[-1].start] = father
        elif (unit := unit_of(element)) is not None:
            found.mm_per_unit = unit
        elif element.name in ("Code", "code"):
            _moves(element.text, found)
    for element in values:
        index, around = element.path[-1], element.path[-2]
        entry = f"{around.attributes.get('name', '?')}[{index.attributes.get('index', '0')}]"
        if entry.lower() not in _ROOTS:
            _add(around.name, entry, element, fathers[around.start], entries, found)
    chains = {entry.name.lower(): entry for entry in entries if entry.kind in ("tool", "frame")}
    for entry in entries:
        try:
            _sort_in(entry, chains, found)
        except (ValueError, InputError) as error:
            found.skip(entry.line, explained(f"{entry.name}", error))
    return found


def _value(element: Element, around: Element, entries: list[_Entry], found: Found) -> None:
    kind = re.sub(r"(rx|Rx|RX2?|rs|Rs)$", "", around.attributes.get("type", ""))
    if kind in ("tool", "frame", "point", "joint"):
        name = f"{around.attributes.get('name', '?')}[{element.attributes.get('key', '0')}]"
        _add(kind, name, element, element.attributes.get("fatherId", ""), entries, found)


def _add(kind: str, name: str, element: Element, father: str, entries: list[_Entry], found: Found) -> None:
    try:
        if kind == "joint":
            joints = tuple(number(element.attributes.get(f"j{i}", "0")) for i in range(1, 7))
            found.poses.append(Taught(name, None, "staubli", element.line, joints, file=found.file))
            return
        pose = tuple(number(element.attributes.get(axis, "0")) for axis in _NAMES)
    except ValueError as error:
        found.skip(element.line, explained(f"{name}", error))
        return
    entries.append(_Entry(kind, name, pose, father, element.line))


def _sort_in(entry: _Entry, chains: dict[str, _Entry], found: Found) -> None:
    if entry.kind == "point":
        father = entry.father if entry.father.lower() not in _ROOTS else "world"
        found.poses.append(
            Taught(entry.name, entry.pose, "staubli", entry.line, None, None, None, father, found.file)
        )
        return
    pose, father, seen = entry.pose, entry.father, {entry.name.lower()}
    while father.lower() not in _ROOTS:
        outer = chains.get(father.lower())
        if outer is None or outer.kind != entry.kind:
            raise ValueError(message("it stands in {father}, which the file does not define", father=father))
        if outer.name.lower() in seen:
            raise ValueError(message("it stands in itself, by {father}", father=father))
        seen.add(outer.name.lower())
        product = parse_pose("staubli", outer.pose).matrix @ parse_pose("staubli", pose).matrix
        pose, father = tuple(to_pose("staubli", RigidTransform(product, "base", "tool0"))), outer.father
    frame = Frame(entry.name, entry.name, pose, "staubli", entry.line, found.file)
    (found.tools if entry.kind == "tool" else found.frames).append(frame)


def _moves(code: str, found: Found) -> None:
    for move in _MOVE.finditer(code):
        arguments = [a.strip() for a in move[1].split(",")]
        if len(arguments) >= 3 and all(re.fullmatch(r"\w+(?:\[\d+\])?", a) for a in arguments[:2]):
            point, tool = (a if a.endswith("]") else f"{a}[0]" for a in arguments[:2])
            found.moves.setdefault(point.lower(), set()).add((tool, None))
