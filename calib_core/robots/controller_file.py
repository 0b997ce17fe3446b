"""What a controller's file holds: poses, tools, frames, and what was skipped."""

from dataclasses import dataclass, field
from typing import Any

from calib_core.arms.configuration import Configuration
from calib_core.proof import Proof

Reference = int | str
"""A tool's or frame's number, or its name where the brand names them."""


@dataclass(frozen=True)
class Skipped:
    """Something that was not taken, and why."""

    line: int
    reason: str
    file: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {"line": self.line, "reason": self.reason, "file": self.file or None}


@dataclass(frozen=True)
class Frame:
    """A tool, or a user frame.

    Parameters
    ----------
    number : int or str
        As poses refer to it.
    name : str or None
        What the file calls it besides.
    pose : tuple of float
        In the brand's convention: the tool in the flange, the frame in the base.
    convention : str
    line : int
    moving : str
        Why it does not stand where its pose says (a frame that the robot or another mechanism carries, a tool that
        stands still), or empty.
    group : int
        The motion group that it belongs to.
    doubt : str
        What the file leaves open about it, or empty.
    by_program : bool
        Whether a program sets it, when it runs: what the controller's state says outranks that.
    """

    number: Reference
    name: str | None
    pose: tuple[float, ...]
    convention: str
    line: int
    file: str = ""
    moving: str = ""
    group: int = 1
    doubt: str = ""
    by_program: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {
            "number": self.number if isinstance(self.number, int) else None,
            "name": self.name or (None if isinstance(self.number, int) else self.number),
            "pose": list(self.pose),
            "convention": self.convention,
            "line": self.line,
            "file": self.file or None,
            "moving": self.moving or None,
        }


@dataclass(frozen=True)
class Taught:
    """A pose as it stands in a file: of a tool, in a frame; None where the file does not say which.

    Parameters
    ----------
    name : str
    numbers : tuple of float or None
        In `convention`; None where the file has joints alone.
    joints_deg : tuple of float or None
        mm for a prismatic joint.
    external : dict of str to float or None
        External axes by their names, in the file's units.
    tool, frame : int or str or None
    line : int
    refused : str
        Why it cannot be used at all, or empty.
    doubt : str
        What the file leaves open about it, or empty.
    time_s : float or None
        When the robot was there, by the recording's clock.
    configuration : Configuration or None
        How the arm stands, where the file says so.
    """

    name: str
    numbers: tuple[float, ...] | None
    convention: str
    line: int
    joints_deg: tuple[float, ...] | None = None
    external: dict[str, float] | None = None
    tool: Reference | None = None
    frame: Reference | None = None
    file: str = ""
    refused: str = ""
    doubt: str = ""
    time_s: float | None = None
    configuration: Configuration | None = None


@dataclass
class Found:
    """What one file holds, as its reader collects it; tools and frames are not applied yet.

    `tool`/`frame` of poses may be given later by `settled`, as moves in another file do.
    """

    file: str = ""
    poses: list[Taught] = field(default_factory=list)
    tools: list[Frame] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    moves: dict[str, set[tuple[Reference | None, Reference | None]]] = field(default_factory=dict)
    """The (tool, frame) pairs with which moves use a pose, by the pose's name in lower case."""
    wanted: dict[str, tuple[str, int]] = field(default_factory=dict)
    """The named positions that moves go to: as written and the first line, by the name in lower case."""
    unread: set[str] = field(default_factory=set)
    """Named positions that stand in the file and could not be taken, in lower case: they are in `skipped`."""
    changed: dict[tuple[str, str], int] = field(default_factory=dict)
    """Lines in which a program changes a `tool` or `frame`, by its number, or a `point` of a file beside it."""
    active_tool: Reference | None = None
    active_frame: Reference | None = None
    """What the controller had active when the file was saved, where the file says so."""
    mm_per_unit: float | None = None
    """The unit of lengths that the file states for those beside it."""

    def skip(self, line: int, reason: str, name: str = "") -> None:
        """Note something that is not taken, and the name of the position where it has one."""
        self.skipped.append(Skipped(line, reason, self.file))
        if name:
            self.unread.add(name.lower())

    def change(self, what: str, number: str, line: int) -> None:
        """Note that a program changes a tool, a frame or a point."""
        self.changed.setdefault((what, number.lower()), line)

    def want(self, name: str, line: int) -> None:
        """Note that a move goes to a named position."""
        self.wanted.setdefault(name.lower(), (name, line))


@dataclass(frozen=True)
class FilePose:
    """One pose of the flange in the base, as far as the file tells it.

    `pose` is base_from_tool0 in `convention`; None where the file has joints alone. `doubt` is what is left open.
    """

    name: str
    pose: tuple[float, ...] | None
    convention: str
    joints_deg: tuple[float, ...] | None
    external: dict[str, float] | None
    tool: Reference | None
    frame: Reference | None
    line: int
    file: str = ""
    as_written: tuple[float, ...] | None = None
    doubt: str = ""
    time_s: float | None = None
    configuration: Configuration | None = None

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {
            "name": self.name,
            "pose": None if self.pose is None else list(self.pose),
            "convention": self.convention,
            "joints_deg": None if self.joints_deg is None else list(self.joints_deg),
            "external": self.external,
            "tool": self.tool,
            "frame": self.frame,
            "line": self.line,
            "file": self.file or None,
            "as_written": None if self.as_written is None else list(self.as_written),
            "doubt": self.doubt or None,
            "time_s": self.time_s,
        }


@dataclass(frozen=True)
class ControllerFile:
    """Poses, tools and frames of a controller's file or backup."""

    brand: str
    poses: tuple[FilePose, ...]
    tools: tuple[Frame, ...]
    frames: tuple[Frame, ...]
    skipped: tuple[Skipped, ...]
    notes: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    proof: Proof = "manual only"

    def to_json(self) -> dict[str, Any]:
        """Return all of it as JSON data, as `scancell poses --json` prints it."""
        return {
            "brand": self.brand,
            "poses": [pose.to_json() for pose in self.poses],
            "tools": [tool.to_json() for tool in self.tools],
            "frames": [frame.to_json() for frame in self.frames],
            "skipped": [skipped.to_json() for skipped in self.skipped],
            "notes": list(self.notes),
            "files": list(self.files),
            "proof": self.proof,
        }
