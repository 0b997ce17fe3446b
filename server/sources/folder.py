"""A folder that something else writes captures into: which files are whole, and which capture each makes.

A file counts once its size and time have rested for a while: a scanner or a share may write it in portions.  Its
pose comes from beside it: `NAME.json` with fields of the capture's record, `NAME.txt` or `NAME.pose` with a pose
line, or a line that begins with the file's name in `poses.txt` or `poses.csv`.  Nothing in the folder is changed.
"""

import json
import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib_core.disk import is_system_file
from calib_core.errors import InputError
from calib_core.messages import plural
from calib_core.moment import text_of_seconds
from calib_core.records import Capture, Session, StepName, parse_capture
from calib_core.steps import steps_that_show

POSE_FILES = ("poses.txt", "poses.csv")
_POSE_ENDINGS = (".txt", ".pose")
_MAX_NOTE_BYTES = 1_000_000

Signature = tuple[int, int]
"""A file's size in bytes and the time of its last change in nanoseconds."""


@dataclass
class Resting:
    """How long files have rested: their signatures and since when (monotonic, s) these have been so."""

    rest_s: float = 1.0
    _seen: dict[str, tuple[Signature, float]] = field(default_factory=dict[str, tuple[Signature, float]])

    def rested(self, found: dict[str, Signature], now_s: float) -> set[str]:
        """Return the names whose files have not changed for `rest_s`, and forget those that are gone."""
        before = self._seen
        self._seen = {}
        for name, signature in found.items():
            known = before.get(name)
            self._seen[name] = known if known is not None and known[0] == signature else (signature, now_s)
        return {name for name, (_, since_s) in self._seen.items() if now_s - since_s >= self.rest_s}


def files_in(folder: Path) -> dict[str, Signature]:
    """Return the plain files of a folder that are not hidden, a system's, empty or links; raises OSError."""
    found: dict[str, Signature] = {}
    with os.scandir(folder) as entries:
        for entry in entries:
            ours = not entry.name.startswith("~") and not is_system_file(entry.name)
            if not ours or not entry.is_file(follow_symlinks=False):
                continue
            status = entry.stat(follow_symlinks=False)
            if status.st_size:
                found[entry.name] = (status.st_size, status.st_mtime_ns)
    return found


def measurements(names: Collection[str]) -> list[str]:
    """Return those names that hold a capture, in the order of their names; pose tables are none."""
    return sorted(n for n in names if _usual_kind(n) and n.lower() not in POSE_FILES)


def notes_of(name: str, names: Collection[str]) -> list[str]:
    """Return the files that may tell the pose of a measurement, the closest first."""
    stem = Path(name).stem
    return [note for note in (f"{stem}.json", *(stem + e for e in _POSE_ENDINGS), *POSE_FILES) if note in names]


def capture_of(
    folder: Path, name: str, notes: list[str], session: Session, step: StepName, taken: set[str]
) -> Capture:
    """Return the capture that a file makes.

    Parameters
    ----------
    folder : Path
    name : str
        Of the measurement.
    notes : list of str
        The files that may tell its pose (see `notes_of`).
    session : Session
        Its cell's convention reads the pose.
    step : str
        What captures are taken for where the note says nothing else.
    taken : set of str
        Ids that the session has already.

    Raises
    ------
    InputError
        If a note cannot be used, or none tells the pose.
    """
    record: dict[str, Any] = {"step": step, "kind": _kind(name, session)}
    for note in notes:
        record |= _said(folder, note, name, session)
        if "pose" in record or Path(note).suffix == ".json":
            break
    if "pose" not in record and record["step"] not in steps_that_show("board") and record["kind"] != "center":
        to_do = "Write {name}.txt with the pose line, or a line that begins with {name_other} in poses.txt."
        raise InputError("the pose of this file", "none", to_do, name, name=Path(name).stem, name_other=name)
    wanted = str(record.pop("id", "")) or Path(name).stem
    capture_id = _free_id(wanted, taken)
    file = f"captures/{capture_id}{Path(name).suffix.lower()}"
    if "taken" not in record:
        written = text_of_seconds((folder / name).stat().st_mtime)
        record = {"taken": written, "clock": "file", **record}
    return parse_capture({**record, "id": capture_id, "files": [file]}, name)


def _usual_kind(name: str) -> str | None:
    """Return what a file holds by its ending; texts tell poses here."""
    from calib_core.formats.points import usual_kind

    return None if Path(name).suffix.lower() in _POSE_ENDINGS else usual_kind(name)


def _kind(name: str, session: Session) -> str:
    kind = _usual_kind(name) or "profile"
    return "cloud" if kind == "profile" and session.cell.scanner.kind == "cloud" else kind


def _said(folder: Path, note: str, name: str, session: Session) -> dict[str, Any]:
    """Return the fields of the record that a note gives, none where it says nothing of this file."""
    content = (folder / note).read_bytes()
    if len(content) > _MAX_NOTE_BYTES:
        got = plural("{count} byte", "{count} bytes", by="count", count=len(content))
        to_do = "Keep pose lines alone in it."
        raise InputError("a short note", got, to_do, note)
    text = content.decode("utf-8-sig", errors="replace")
    if Path(note).suffix == ".json":
        return _fields(text, note)
    for line in _lines_about(text, name) if note in POSE_FILES else iter([text]):
        return {"pose": _pose(line, note, session)}
    return {}


def _fields(text: str, note: str) -> dict[str, Any]:
    try:
        data: Any = json.loads(text)
    except ValueError as error:
        to_do = "Write the capture's record as JSON."
        raise InputError("JSON", "something else ({error})", to_do, note, error=error) from None
    if not isinstance(data, dict):
        raise InputError("a JSON object", type(data).__name__, "Write the capture's record as JSON.", note)
    return {name: value for name, value in data.items() if name not in ("files", "measured")}


def _lines_about(text: str, name: str) -> Iterator[str]:
    """Yield the lines that begin with a file's name, the last one first, without the name."""
    for line in reversed(text.splitlines()):
        for own in (name, Path(name).stem):
            if line.startswith(own) and line[len(own) : len(own) + 1] in (" ", "\t", ",", ";", ":"):
                yield line[len(own) + 1 :]
                break


def _pose(text: str, note: str, session: Session) -> list[float]:
    from calib_core.robots import parse_pose_lines

    rows = parse_pose_lines(session.cell.pose_convention, text)
    if len(rows) != 1 or rows[0].numbers is None or rows[0].pose is None:
        got = (
            rows[0].problem
            if len(rows) == 1 and rows[0].problem
            else plural("{count} pose", "{count} poses", by="count", count=len(rows))
        )
        raise InputError("a pose", got, "Write one pose in the cell's convention.", note)
    return list(rows[0].numbers)


def _free_id(wanted: str, taken: set[str]) -> str:
    clean = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in wanted).lstrip("._-")[:56]
    clean = clean or "capture"
    numbers = iter(range(2, len(taken) + 3))
    free = clean
    while free in taken:
        free = f"{clean}-{next(numbers)}"
    return free
