"""What the writers of controllers' files share: settings, numbers as text, the note on where they come from."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, StringConstraints

from calib_core.errors import ConflictError, InputError
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export, Patch, Settings
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.poses.numbers import to_pose
from calib_core.records.faults import FAULTS

Part = Literal["tool", "table", "both"]
DottedName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][\w.]{0,31}(\[\d{1,4}\])?$")]
"""A name as Kawasaki's variables have it."""
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_]\w{0,31}(\[\d{1,4}\])?$")]


class ControllerSettings(Settings):
    """What of the answer is written; of a backup, the scanner alone unless `part` says otherwise.

    A scanner that stands still is written as a user frame: `scanner_frame`, or `frame` where there is no table.
    `of_scanner` names the scanner of a cell that has several.
    """

    part: Part | None = None
    of_scanner: str | None = None


class NumberedSettings(ControllerSettings):
    """Which tool and user frames are written."""

    tool: int = Field(default=1, ge=0, le=999)
    frame: int = Field(default=1, ge=0, le=999)
    scanner_frame: int | None = Field(default=None, ge=0, le=999)

    def of_fixed_scanner(self, with_table: bool) -> Self:
        """Return them with the user frame of a scanner that stands still; left out, the one after the table's."""
        number = self.frame + with_table if self.scanner_frame is None else self.scanner_frame
        return self.model_copy(update={"frame": number})


class NamedSettings(ControllerSettings):
    """What tool and user frames are called."""

    tool: Name = "tScanner"
    frame: Name = "fTable"
    scanner_frame: Name = "fScanner"

    def of_fixed_scanner(self, with_table: bool) -> Self:
        """Return them with the user frame of a scanner that stands still."""
        named = "frame" in self.model_fields_set and "scanner_frame" not in self.model_fields_set
        return self if named and not with_table else self.model_copy(update={"frame": self.scanner_frame})


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
        What it is, of a user frame.
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
        If the table is asked for and there is none.
    """
    with_scanner, with_table = wanted(answer, settings.part, default)
    scanner = to_pose(convention, RigidTransform(answer.mount_from_laser.matrix, "base", "tool0"))
    if with_scanner and answer.mount_from_laser.into == "tool0":
        yield Written("tool", scanner, settings)
    elif with_scanner:
        own = settings.of_fixed_scanner(with_table)
        yield Written("frame", scanner, own, "the scanner, which stands still: its frame in base")
    if with_table:
        note = "the turntable at 0 deg: z is its axis"
        yield Written("frame", table_pose(answer, convention), settings, note)


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


def as_bytes_kept(backup: bytes) -> tuple[str, str]:
    """Return a backup's text and the encoding that turns it back into the very same bytes."""
    for mark_of, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if backup.startswith(mark_of) and len(backup) % 2 == 0:
            return backup.decode(encoding, errors="surrogatepass"), encoding
    return backup.decode("latin-1"), "latin-1"


def put_back(text: str, encoding: str) -> bytes:
    """Return the bytes of a text that `as_bytes_kept` gave."""
    return text.encode(encoding, errors="surrogatepass" if encoding != "latin-1" else "strict")


def only_match(pattern: str, text: str, what: str, flags: int = re.MULTILINE | re.IGNORECASE) -> re.Match[str]:
    """Return the one match of an entry in a backup.

    Raises
    ------
    InputError
        If the entry is not there, or more than once.
    """
    found = list(re.finditer(pattern, text, flags))
    if len(found) != 1:
        got = message("{count} of them", count=len(found)) if found else message("none")
        to_do = message("Give the file that defines it, or name another with --tool or --frame.")
        raise InputError("one {what} in the backup", got, to_do, "into", what=what)
    return found[0]


def replaced(text: str, begin: int, end: int, new: str) -> str:
    """Return a text with one stretch of it replaced."""
    return text[:begin] + new + text[end:]


def patched_line(backup: bytes, answer: Answer, comment: str, entries: Iterable[tuple[str, str, str]]) -> bytes:
    """Return a program with the numbers of some entries changed; every other line stays byte for byte.

    Parameters
    ----------
    backup : bytes
    answer : Answer
        For the short note at the line's end (lines are limited there); it takes the place of an earlier one.
    comment : str
        What a comment begins with.
    entries : iterable of tuple
        (what the entry is called, a pattern of its line up to and with the bracket, its six numbers); what stands
        behind six numbers in the bracket stays.

    Raises
    ------
    InputError
        If an entry is not there, or more than once.
    """
    text, encoding = as_bytes_kept(backup)
    number = r"[ \t]*[-+.\deE]+[ \t]*"
    note = f"{comment}{mark(answer)} {answer.date[:10] or 'without date'}, {answer.position_sigma_mm:.3f} mm"
    for what, before, numbers in entries:
        found = only_match(rf"{before}({number}(?:,{number}){{5}})(?=[,)])([^\r\n]*)", text, what)
        kept = re.sub(rf"[ \t]*{re.escape(comment)}(?:DO-NOT-USE|SCANCELL) .*", "", found[2]).rstrip()
        text = replaced(text, found.start(1), found.end(2), f"{numbers}{kept} {note}")
    return put_back(text, encoding)


def patched_by(
    convention: str, put: Callable[[str, Literal["tool", "frame"], list[float], Any, Answer], str]
) -> Patch:
    """Return what changes the tool of a backup, its user frame or both, and leaves every other byte as it is.

    Parameters
    ----------
    convention : str
        Of the brand's numbers.
    put : callable
        (text, which of the two, its numbers, settings, answer) to the text with that entry changed.
    """

    def patch(backup: bytes, answer: Answer, settings: Any) -> bytes:
        text, encoding = as_bytes_kept(backup)
        for one in frames_written(answer, settings, convention, "tool"):
            text = put(text, one.kind, one.pose, one.settings, answer)
        return put_back(text, encoding)

    return patch


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
