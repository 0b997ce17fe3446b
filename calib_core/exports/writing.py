"""What the writers of controllers' files share: settings, numbers as text, the note on where they come from."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, StringConstraints

from calib_core.errors import ConflictError
from calib_core.exports.answer import Answer
from calib_core.exports.axis_frames import other_axes, table_axis
from calib_core.exports.entry import Export, Patch, Settings
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.poses.numbers import to_pose
from calib_core.records.faults import FAULTS

Part = Literal["tool", "table", "both"]
DottedName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][\w.]{0,31}(\[\d{1,4}\])?$")]
"""A name as Kawasaki's variables have it."""
_LONGEST: Final = 32
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_]\w{0,31}(\[\d{1,4}\])?$")]


class ControllerSettings(Settings):
    """What of the answer is written; of a backup, the scanner alone unless `part` says otherwise.

    A scanner that stands still is written as a user frame: `scanner_frame`, or `frame` where there is no table.
    `of_scanner` names the scanner of a cell that has several; left out, a file of its own has all of them.
    """

    part: Part | None = None
    of_scanner: str | None = None

    def of_one(self, which: int, name: str) -> Self:
        """Return them with the tool of one of several scanners; raises ConflictError where a program has one."""
        raise several_scanners()

    def of_axis(self, which: int, name: str) -> Self | None:
        """Return them with the user frame of another axis than the table; None where a program has one."""
        return None


class NumberedSettings(ControllerSettings):
    """Which tool and user frames are written."""

    tool: int = Field(default=1, ge=0, le=999)
    frame: int = Field(default=1, ge=0, le=999)
    scanner_frame: int | None = Field(default=None, ge=0, le=999)

    def of_fixed_scanner(self, before: int) -> Self:
        """Return them with the user frame of a scanner that stands still; left out, the one after those before."""
        number = self.frame + before if self.scanner_frame is None else self.scanner_frame
        return self.model_copy(update={"frame": number})

    def of_one(self, which: int, name: str) -> Self:
        """Return them with the next tool, and user frame, of one of several scanners."""
        frame = None if self.scanner_frame is None else self.scanner_frame + which
        return self.model_copy(update={"tool": self.tool + which, "scanner_frame": frame})

    def of_axis(self, which: int, name: str) -> Self:
        """Return them with the next user frame after those of the table and of scanners."""
        return self.model_copy(update={"frame": self.frame + which})


class NamedSettings(ControllerSettings):
    """What tool and user frames are called."""

    tool: Name = "tScanner"
    frame: Name = "fTable"
    scanner_frame: Name = "fScanner"

    def of_fixed_scanner(self, before: int) -> Self:
        """Return them with the user frame of a scanner that stands still."""
        named = "frame" in self.model_fields_set and "scanner_frame" not in self.model_fields_set
        return self if named and not before else self.model_copy(update={"frame": self.scanner_frame})

    def of_one(self, which: int, name: str) -> Self:
        """Return them with the tool, and user frame, that are called after one of several scanners."""
        update = {"tool": _called(self.tool, name), "scanner_frame": _called(self.scanner_frame, name)}
        return self.model_copy(update=update)

    def of_axis(self, which: int, name: str) -> Self:
        """Return them with a user frame that is called after another axis."""
        return self.model_copy(update={"frame": _called(self.frame, name)})


def require_one_scanner(answer: Answer, settings: ControllerSettings) -> None:
    """Raise ConflictError where one entry of a backup would be any of several scanners."""
    if settings.of_scanner is None and len(answer.scanners()) > 1:
        raise several_scanners()


def several_scanners() -> ConflictError:
    """Return the refusal to write one tool of several scanners."""
    need = message("the name of one scanner in `of_scanner`: one tool is written")
    return ConflictError(need, "several scanners", "Export each with its own `of_scanner`.", "of_scanner")


def _called(name: str, of: str) -> str:
    """Return a name with that of what it belongs to, as controllers take it."""
    plain, bracket, rest = name.partition("[")
    return f"{plain}_{re.sub(r'[^A-Za-z0-9]+', '_', of)}"[:_LONGEST] + bracket + rest


@dataclass(frozen=True)
class Written:
    """A frame as a controller takes it: the robot's tool, or a user frame.

    Attributes
    ----------
    kind : str
    pose : list of float
        In the controller's convention.
    settings : Settings
        Whose `tool` or `frame` is its own.
    note : str
        What it is, of a user frame, and of one of several tools.
    """

    kind: Literal["tool", "frame"]
    pose: list[float]
    settings: Any
    note: str = ""


def frames_written(answer: Answer, settings: Any, convention: str, default: Part) -> Iterator[Written]:
    """Give what is to be written: the scanner, as a user frame where it stands still, and the table.

    Raises
    ------
    ConflictError
        If the table is asked for and there is none, or one of several scanners is to be named.
    """
    with_scanner, with_table = wanted(answer, settings.part, default)
    whole, frames = default == "both", int(with_table)
    if with_scanner and not whole:
        require_one_scanner(answer, settings)
    several = answer.scanners() if whole and settings.of_scanner is None else {}
    scanners = {name: frame for name, (frame, _) in several.items()} if len(several) > 1 else {}
    for which, (name, frame) in enumerate((scanners or {"": answer.mount_from_laser}).items()):
        if not with_scanner:
            break
        pose = to_pose(convention, RigidTransform(frame.matrix, "base", "tool0"))
        own = settings.of_one(which, name) if scanners else settings
        called = f"the scanner {ascii_of(name)}" if name else "the scanner"
        if frame.into == "tool0":
            yield Written("tool", pose, own, called if name else "")
        else:
            own = own.of_fixed_scanner(frames)
            frames += 1
            yield Written("frame", pose, own, f"{called}, which stands still: its frame in base")
    if with_table:
        yield Written("frame", table_pose(answer, convention), settings, _note_of(answer, table_axis(answer)))
    others = [axis for axis in other_axes(answer) if axis.carries == "object"] if whole and with_table else []
    for which, axis in enumerate(others, frames):
        if (own := settings.of_axis(which, axis.name)) is not None:
            pose = to_pose(convention, RigidTransform(axis.frame.matrix, "base", "tool0"))
            yield Written("frame", pose, own, _note_of(answer, axis.name))


def _note_of(answer: Answer, axis: str) -> str:
    """Return what the frame of an axis is, in ASCII."""
    named = {one.name: one for one in answer.session.cell.axes or ()}
    if axis not in named:
        return "the turntable at 0 deg: z is its axis"
    along = "z is along it" if named[axis].kind == "linear" else "z is its axis"
    return f"the axis {ascii_of(axis)}, all axes at 0: {along}"


def wanted(answer: Answer, part: Part | None, default: Part) -> tuple[bool, bool]:
    """Return whether tool and table are to be written.

    Raises
    ------
    ConflictError
        If the table is asked for and there is none.
    """
    chosen = part or default
    has_table = answer.base_from_turntable is not None
    if chosen == "table" and not has_table:
        raise ConflictError("a solved turntable", "none", "Solve the turntable first, or export the tool.", "part")
    return chosen != "table", chosen != "tool" and has_table


def tool_pose(answer: Answer, convention: str) -> list[float]:
    """Return the tool as a controller's numbers."""
    return to_pose(convention, answer.tool)


def table_pose(answer: Answer, convention: str) -> list[float]:
    """Return base_from_turntable as a controller's numbers."""
    if answer.base_from_turntable is None:
        raise ConflictError("a solved turntable", "none", "Solve the turntable first.", "part")
    return to_pose(convention, answer.base_from_turntable)


def fixed(value: float, digits: int) -> str:
    """Return a number with fixed digits, never as minus zero."""
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def listed(pose: Iterable[float], position: int, orientation: int, separator: str = ",") -> str:
    """Return a pose's numbers with fixed digits for position and orientation."""
    return separator.join(fixed(v, position if i < 3 else orientation) for i, v in enumerate(pose))


MARKS: Final = ("NOT TO BE USED", "not_to_be_used", "DO-NOT-USE", "DO NOT USE", "ATTENTION", "attention")
"""How files say that their answer has faults."""


def marked(content: str | bytes, answer: Answer, entry: Export) -> str | bytes:
    """Return what an export wrote with a line that names the answer's faults, where its writer does not mark it.

    Raises
    ------
    ConflictError
        If the file is no text, so that it cannot be marked.
    """
    if not answer.all_faults:
        return content
    data = content.encode() if isinstance(content, str) else content
    if any(mark_of.encode(encoding) in data for mark_of in MARKS for encoding in ("ascii", "utf-16-le")):
        return content
    try:
        text = data.decode()
    except UnicodeDecodeError:
        need = "an answer without faults for a format that is no text and does not mark it"
        to_do = "Mend the answer, or choose another format."
        raise ConflictError(
            need, "one with {faults}", to_do, entry.name, faults=", ".join(answer.all_faults)
        ) from None
    return "".join(f"{entry.comment} {line}\n" for line in _faults_told(answer)) + text


def _faults_told(answer: Answer) -> list[str]:
    faults = " and ".join(FAULTS[name].said for name in answer.faults)
    also = " and ".join(FAULTS[name].said for name in answer.of_moment)
    return [
        *([f"NOT TO BE USED: this answer is {faults}"] if faults else []),
        *([f"ATTENTION: this answer is {also}"] if also else []),
    ]


def provenance(answer: Answer, of_arm: bool = False) -> list[str]:
    """Return what a person at the controller should know, in ASCII: session, uncertainty, date, hash.

    An answer with faults says so first. `of_arm` is for what holds the arm, and no scanner.
    """
    name = ascii_of(answer.session.name) or "without a name"
    position, rotation = answer.position_sigma_mm, answer.rotation_sigma_deg
    seen = answer.laser_from_turntable is not None
    what = (
        "turntable in the scanner's frame (laser)"
        if seen
        else f"scanner frame (laser) in {answer.mount_from_laser.into}"
    )
    of_scanner = [
        f"standard uncertainty {position:.4f} mm, {rotation:.5f} deg (worst axis)",
        *_whose_poses(answer),
    ]
    return [
        *_faults_told(answer),
        f"scancell: {'arm' if of_arm else what}, of session {name}",
        f"stage {answer.stage}, verdict {answer.verdict}, solved {answer.date[:10] or 'at an unknown date'}",
        *([] if of_arm else of_scanner),
        f"inputs sha256 {answer.inputs_sha256[:16]}",
    ]


def _whose_poses(answer: Answer) -> list[str]:
    """Return with which poses the answer is to be used, where those that the arm's errors correct are others."""
    model = answer.results.get(answer.stage, {}).get("arm_model") or {}
    if model.get("applied"):
        return ["for poses corrected by the arm's errors, not for the controller's own"]
    asked = answer.session.cell.robot.errors == "apply" and model.get("worth_it")
    return ["for the controller's own poses, not for those corrected by the arm's errors"] if asked else []


_REMARK = 30


def mark(answer: Answer, longest: int = 32) -> str:
    """Return a short name for the entry, where a format has no comments: it tells an answer with faults too."""
    prefix = "DO-NOT-USE" if answer.faults else "SCANCELL"
    return f"{prefix} {answer.inputs_sha256[:8]}"[:longest]


def ascii_of(text: str) -> str:
    """Return a text as controllers' editors take it: one line of ASCII, without quotes."""
    plain = text.encode("ascii", "replace").decode()
    return re.sub(r"[\x00-\x1f\"'*/\\<>{};!]+", " ", plain).strip()[:60]


def remarks(line: str) -> list[str]:
    """Return a line in pieces that fit a remark."""
    pieces = [""]
    for word in line.split():
        if pieces[-1] and len(pieces[-1]) + len(word) >= _REMARK:
            pieces.append("")
        pieces[-1] = f"{pieces[-1]} {word}".strip()[:_REMARK]
    return pieces


Lines = Callable[[list[float], Any, Answer], Sequence[str]]


def program_export(
    name: str,
    title: str,
    suffix: str,
    comment: str,
    settings: type[Settings],
    tool: Lines,
    frame: Lines,
    around: tuple[Sequence[str], Sequence[str]] = ((), ()),
    patch: Patch | None = None,
    convention: str | None = None,
) -> Export:
    """Return the export of a brand whose programs are lines with comments.

    Parameters
    ----------
    name, title, suffix : str
        Of the export.
    comment : str
        What a comment begins with.
    settings : type
        With a field `part`.
    tool, frame : callable
        (its numbers, settings, answer) to the lines that set the tool, and the user frame.
    around : pair of sequence of str
        Lines before and after.
    patch : callable, optional
        As in `Export`.
    convention : str, optional
        Of the numbers; that of the brand's own name where it is left out.
    """
    numbers_of = convention or name

    def write(answer: Answer, chosen: Any) -> str:
        lines = [*around[0], *(f"{comment}{line}" for line in provenance(answer))]
        for one in frames_written(answer, chosen, numbers_of, "both"):
            lines += [f"{comment}{one.note}"] if one.note else []
            lines += (tool if one.kind == "tool" else frame)(one.pose, one.settings, answer)
        return "\r\n".join([*lines, *around[1]]) + "\r\n"

    return Export(name, title, "text/plain", suffix, write, settings, name, patch)
