"""Kawasaki AS: transformations and joints of a saved file, and the TOOL and BASE of its programs."""

import re

from calib_core.messages import explained, message
from calib_core.robots.controller_file import Found, Frame, Reference, Taught
from calib_core.robots.phrases import CALCULATED, CUT, of_line, require_count
from calib_core.robots.text import numbers, source_of, without_comments

_SECTION = re.compile(r"^[ \t]*\.(TRANS|JOINTS|REALS|STRINGS|INTEGER|PROGRAM|END|[A-Z_]+)\b(.*)$", re.IGNORECASE)
_NAME = r"[#.]?[A-Za-z_][\w.]*(?:\[[\d,\s]*\])?"
_ROW = re.compile(rf'^[ \t]*"?({_NAME})"?\s+(\S.*)$')
_TRANS = r"TRANS\s*\(([^()]*)\)"
_POINT = re.compile(rf"^[ \t]*POINT\s+({_NAME})\s*=\s*(.+)$", re.IGNORECASE)
_FRAME = re.compile(r"^[ \t]*(TOOL|BASE)\s+(\S.*?)\s*$", re.IGNORECASE)
_MOVE = re.compile(
    rf"^[ \t]*(LMOVE|JMOVE|LAPPRO|JAPPRO|C1MOVE|C2MOVE|HMOVE|XMOVE)\s+({_NAME})\s*(.*)$", re.IGNORECASE
)


def find(data: bytes, name: str) -> Found:
    """Return what stands in a file saved by a Kawasaki controller."""
    return _Saved(data, name).found()


class _Saved:
    def __init__(self, data: bytes, name: str) -> None:
        self._source = source_of(data, name)
        self._found = Found(name)
        self._active: dict[str, Reference] = {}
        self._used_as: dict[str, str] = {}

    def found(self) -> Found:
        """Return all that the file holds."""
        section, opened = "", 0
        text = without_comments(self._source.text, ";")
        for line, content in enumerate(text.split("\n"), start=1):
            if not content.strip():
                continue
            if begin := _SECTION.match(content):
                if begin[1].upper() != "END" and section in ("TRANS", "JOINTS"):
                    self._found.skip(
                        opened, message(".{section} has no .END before line {line}", section=section, line=line)
                    )
                section, opened = begin[1].upper() if begin[1].upper() != "END" else "", line
                self._active = {}
            elif section in ("TRANS", "JOINTS"):
                self._row(section, content, line)
            elif section == "SYSDATA":
                self._saved(content, line)
            elif section == "PROGRAM":
                self._step(content, line)
        if section in ("TRANS", "JOINTS"):
            self._found.skip(opened, message(".{section} has no .END: {cut}", section=section, cut=CUT))
        self._sort_out_frames()
        return self._found

    def _row(self, section: str, content: str, line: int) -> None:
        row = _ROW.match(content)
        if not row:
            self._found.skip(line, message("'{content}' is no name with numbers", content=content.strip()[:40]))
            return
        name, values = row[1], row[2]
        try:
            self._source.require_ended(line)
            of_joints = section == "JOINTS" or name.startswith("#")
            self._taught(name, numbers(values, separator=" "), line, of_joints)
        except ValueError as error:
            self._found.skip(line, explained(f"{name}", error))

    def _taught(self, name: str, values: tuple[float, ...], line: int, of_joints: bool = False) -> None:
        require_count(values[:6], 6)
        external = {f"JT{i}": v for i, v in enumerate(values[6:], start=7)} or None
        pose, joints = (None, values[:6]) if of_joints else (values[:6], None)
        self._found.poses.append(Taught(name, pose, "kawasaki", line, joints, external, file=self._source.name))

    def _saved(self, content: str, line: int) -> None:
        """Take the tool and the base that were active when a whole backup was saved."""
        saved = _FRAME.match(content)
        if not saved:
            return
        what = saved[1].upper()
        name = message("{what} of .SYSDATA", what=what)
        try:
            self._source.require_ended(line)
            frame = Frame(name, name, numbers(saved[2], 6, separator=" "), "kawasaki", line, self._source.name)
        except ValueError as error:
            self._found.skip(line, explained(f"{name}", error))
            return
        if what == "TOOL":
            self._found.tools.append(frame)
            self._found.active_tool = name
        else:
            self._found.frames.append(frame)
            self._found.active_frame = name

    def _step(self, content: str, line: int) -> None:
        if point := _POINT.match(content):
            self._point(point[1], point[2].strip(), line)
        elif active := _FRAME.match(content):
            self._activate(active[1].upper(), active[2], line)
        elif move := _MOVE.match(content):
            name = move[2].lower()
            if move[3].lstrip().startswith(("+", "-")):
                self._found.skip(
                    line,
                    message(
                        "{move}: a compound position is calculated", move=f"{move[1]} {move[2]}{move[3][:40]}"
                    ),
                )
            elif not name.startswith("#") and self._active:
                used_with = self._active.get("TOOL"), self._active.get("BASE")
                self._found.moves.setdefault(name, set()).add(used_with)

    def _point(self, name: str, value: str, line: int) -> None:
        literal = re.fullmatch(_TRANS, value, re.IGNORECASE)
        try:
            if not literal:
                raise ValueError(CALCULATED)
            self._taught(name, numbers(literal[1]), line)
        except ValueError as error:
            self._found.skip(line, explained(f"{name}", error))

    def _activate(self, what: str, value: str, line: int) -> None:
        literal = re.fullmatch(_TRANS, value, re.IGNORECASE)
        named = re.fullmatch(_NAME, value)
        if value.upper() == "NULL":
            self._active[what] = 0
        elif literal:
            name = of_line(what == "TOOL", line)
            try:
                pose = numbers(literal[1], 6)
                frame = Frame(name, name, pose, "kawasaki", line, self._source.name)
                (self._found.tools if what == "TOOL" else self._found.frames).append(frame)
            except ValueError as error:
                self._found.skip(line, explained(f"{name}", error))
            self._active[what] = name
        elif named:
            self._used_as[value.lower()] = what
            self._active[what] = value
        else:
            self._active[what] = f"{value[:40]} (line {line})"

    def _sort_out_frames(self) -> None:
        """Take transformations that programs use as tools and bases out of the poses."""
        poses: list[Taught] = []
        for taught in self._found.poses:
            what = self._used_as.get(taught.name.lower())
            if what is None or taught.numbers is None:
                poses.append(taught)
                continue
            frame = Frame(taught.name, taught.name, taught.numbers, "kawasaki", taught.line, taught.file)
            (self._found.tools if what == "TOOL" else self._found.frames).append(frame)
        self._found.poses = poses
