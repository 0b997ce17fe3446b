"""Tables of poses: one pose a line, columns named by a header or by the user; nothing about them is assumed."""

import re
from collections.abc import Sequence

from calib_core.errors import InputError
from calib_core.formats.shared.number import number
from calib_core.messages import explained, message, plural
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.numbers import convention_named
from calib_core.robots.controller_file import Found, Frame, Reference, Taught
from calib_core.robots.file_hints import Told
from calib_core.robots.table.columns import OTHERS, roles_of, unit_of
from calib_core.robots.table.units import UNITS, Scale, scale_of
from calib_core.robots.text import Source, source_of

_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?")
_UNENDED = "The file ends in its line without an end of line: make sure that it is whole."


def find(data: bytes, name: str, told: Told) -> Found:
    """Return the poses of a table; a row that cannot be read is skipped aloud.

    Raises
    ------
    InputError
        If the columns, the convention or the unit are not said.
    """
    source = source_of(data, name)
    rows = [(line, text) for line, text in source.lines() if text.strip() and not text.lstrip().startswith("#")]
    if not rows:
        raise InputError("a table of poses", "an empty file", "Save them again.", name)
    separator = _separator([text for _, text in rows])
    head = _cells(rows[0][1], separator)
    has_head = not any(_is_number(cell) for cell in head)
    convention, roles = _columns(head if has_head else [], len(head), told, name)
    body = rows[1:] if has_head else rows
    found = Found(name)
    stated = _unit_stated(head, roles, convention, name) if has_head else ""
    table = _Table(source, found, convention, roles)
    for line, text in body:
        table.row(line, _cells(text, separator))
    table.finish(scale_of(convention, told.unit or stated, table.places(), name))
    return found


def _separator(lines: Sequence[str]) -> str:
    """Return what stands between columns: the one that gives every line the same number of fields, and most."""
    counts = {one: {len(_cells(line, one)) for line in lines} for one in (";", "\t", ",", " ")}
    alike = [one for one, found in counts.items() if len(found) == 1 and min(found) > 5]
    if alike:
        return alike[0]
    return max(counts, key=lambda one: sum(len(_cells(line, one)) > 5 for line in lines))


def _cells(line: str, separator: str) -> list[str]:
    parts = line.split() if separator == " " else line.split(separator)
    return [part.strip().strip('"').strip() for part in parts]


def _is_number(cell: str) -> bool:
    try:
        number(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _columns(head: list[str], width: int, told: Told, where: str) -> tuple[str, list[str]]:
    """Return the convention and what each column is."""
    if told.columns:
        convention = told.convention or ("quaternion-xyzw" if {"qx", "qw"} <= set(told.columns) else None)
        if convention is None:
            to_do = "Say convention=kuka or the like."
            raise InputError("the convention of the poses", "columns alone", to_do, where)
        wanted = [n.lower() for n in convention_named(convention).numbers.split()]
        roles = [column.strip().lower() for column in told.columns]
        if len(roles) != width:
            got = message("{count} for {width} columns", count=len(roles), width=width)
            raise InputError("a name for each column", got, "Name them all; '-' for one to be left aside.", where)
        unknown = [role for role in roles if role not in wanted and role not in OTHERS]
        lacking = [role for role in wanted if roles.count(role) != 1]
        if unknown or lacking:
            got = (
                f"'{unknown[0]}'"
                if unknown
                else message(
                    "{lacking} columns '{lacking_other}'",
                    lacking=roles.count(lacking[0]),
                    lacking_other=lacking[0],
                )
            )
            need = message(
                "columns {wanted} once each, and {others}", wanted=", ".join(wanted), others=", ".join(OTHERS[:5])
            )
            raise InputError(need, got, "Correct it.", where)
        return convention, roles
    convention = None if told.convention is None else convention_named(told.convention).name
    roles = roles_of(head, convention)
    if roles:
        return convention or "quaternion-xyzw", roles
    if convention and not head and len(CONVENTIONS[convention].numbers.split()) == width:
        return convention, [n.lower() for n in CONVENTIONS[convention].numbers.split()]
    to_do = message("Say columns=name,x,y,z,A,B,C and convention=kuka, or the like; '-' for one to be left aside.")
    got = (
        message("the columns {head}", head=", ".join(head[:10]))
        if head
        else message("{width} columns without names", width=width)
    )
    raise InputError("what each column is", got, to_do, where)


def _unit_stated(head: Sequence[str], roles: Sequence[str], convention: str, where: str) -> str:
    """Return the unit of the positions that the header states, or nothing; refuses units that contradict."""
    known = CONVENTIONS[convention]
    names = [n.lower() for n in known.numbers.split()]
    units = {role: unit_of(cell) for cell, role in zip(head, roles, strict=True) if role in names}
    places = {units[axis] for axis in "xyz"}
    angles = {unit.replace("°", "deg") for role, unit in units.items() if role not in ("x", "y", "z")} - {""}
    right = "rad" if known.form == "rotation-vector" else "deg"
    if len(places) > 1 or not places <= {"", *UNITS}:
        named = [unit or message("none") for unit in sorted(places)]
        raise InputError("one unit for x, y and z in the header", "{named}", "Correct it.", where, named=named)
    if angles - {right} and known.form != "quaternion":
        got = message("a header that says {angles}", angles=sorted(angles))
        to_do = message("Convert them, or name another convention than '{convention}'.", convention=convention)
        need = "angles in {right}, as of '{convention}'"
        raise InputError(need, got, to_do, where, right=right, convention=convention)
    return next(iter(places), "")


class _Table:
    def __init__(self, source: Source, found: Found, convention: str, roles: list[str]) -> None:
        self._source, self._found, self._roles = source, found, roles
        self._convention = convention
        self._names = [n.lower() for n in CONVENTIONS[convention].numbers.split()]
        self._rows: list[tuple[int, str, tuple[float, ...], dict[str, str]]] = []

    def row(self, line: int, cells: list[str]) -> None:
        """Take one line."""
        name = f"line {line}"
        try:
            if len(cells) != len(self._roles):
                raise ValueError(
                    plural(
                        "{count} column instead of {count_other}",
                        "{count} columns instead of {count_other}",
                        by="count",
                        count=len(cells),
                        count_other=len(self._roles),
                    )
                )
            by_role = {role: cell for role, cell in zip(self._roles, cells, strict=True) if role != "-"}
            name = by_role.get("name") or name
            self._rows.append((line, name, tuple(_number(by_role[n]) for n in self._names), by_role))
        except ValueError as error:
            self._found.skip(line, explained(f"{name}", error))

    def places(self) -> list[tuple[float, ...]]:
        """Return the positions as they are written."""
        at = [self._names.index(axis) for axis in "xyz"]
        return [tuple(numbers[k] for k in at) for _, _, numbers, _ in self._rows]

    def finish(self, scale: Scale) -> None:
        """Write down all rows, their positions in the convention's unit."""
        for line, name, numbers, cells in self._rows:
            scaled = tuple(
                v * scale.factor if n in ("x", "y", "z") else v for n, v in zip(self._names, numbers, strict=True)
            )
            try:
                joints = _joints(cells)
                external = {"table": _number(cells["table"])} if cells.get("table") else None
            except ValueError as error:
                self._found.skip(line, explained(f"{name}", error))
                continue
            if {"parent", "child"} <= cells.keys():
                self._fixed(cells, scaled, line)
                continue
            doubt = scale.doubt
            if line >= len(self._source.starts) and not self._source.text.endswith("\n"):
                doubt = f"{doubt} {_UNENDED}".strip()
            self._found.poses.append(
                Taught(name, scaled, self._convention, line, joints, external, _reference(cells.get("tool")),
                       _reference(cells.get("frame")), self._found.file, doubt=doubt)
            )  # fmt: skip

    def _fixed(self, cells: dict[str, str], numbers: tuple[float, ...], line: int) -> None:
        """Take a row that says how one frame stands in another, as our own export writes them."""
        parent, child = cells["parent"], cells["child"]
        places = {"tool0": self._found.tools, "flange": self._found.tools, "base": self._found.frames}
        place = places.get(parent.lower())
        if place is None:
            self._found.skip(
                line, message("{child} in {parent}: neither the flange nor the base", child=child, parent=parent)
            )
        else:
            place.append(Frame(child, child, numbers, self._convention, line, self._found.file))


def _number(cell: str) -> float:
    return number(cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell.replace("−", "-"))


def _joints(cells: dict[str, str]) -> tuple[float, ...] | None:
    found = [cells[f"j{k}"] for k in range(1, 8) if f"j{k}" in cells]
    return tuple(map(_number, found)) if found and all(found) else None


def _reference(text: str | None) -> Reference | None:
    return int(text) if text and text.isdigit() else text or None
