"""A session folder made of files as they lie: each recognised, copied, and named for what it was taken for."""

import hashlib
import os
import shutil
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib_core.disk import remove_folder
from calib_core.errors import ConflictError, InputError
from calib_core.formats.format import Unit
from calib_core.messages import message
from calib_core.moment import text_of_seconds
from calib_core.recognition.taken import GivenFile, TakenFor

if TYPE_CHECKING:
    from calib_core.recognition.session import MadeSession
    from calib_core.records import Session

_WHOLE_BYTES = 4_000_000
_WHOLE_IN_ALL_BYTES = 512_000_000
_MOST_FILES = 20_000


@dataclass(frozen=True)
class NewSession:
    """A session folder that was made: of each file what it was taken for, and what is still missing."""

    folder: Path
    files: tuple[Mapping[str, Any], ...]
    missing: tuple[str, ...]
    notes: tuple[str, ...]
    captures: int

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data, as `scancell new --json` prints it."""
        files = [dict(file) for file in self.files]
        return {
            "session": str(self.folder),
            "files": files,
            "missing": list(self.missing),
            "notes": list(self.notes),
            "captures": self.captures,
        }


def new_session(
    folder: str | Path,
    out: str | Path | None = None,
    convention: str | None = None,
    sphere_mm: float | None = None,
    told: Mapping[str, TakenFor] | None = None,
    unit: Unit | None = None,
    arm: str | None = None,
) -> NewSession:
    """Make a session folder of the files that lie in a folder and in those below it; nothing in it is changed.

    Parameters
    ----------
    folder : str or Path
        Links in it are not followed.
    out : str or Path, optional
        Where the session is written; left out, `FOLDER-session` beside it.
    convention : str, optional
        In which the poses are written; left out, the files or the poses themselves tell it.
    sphere_mm : float, optional
        The sphere's diameter.
    told : mapping, optional
        What files are taken for, by their names, whatever their content says.
    unit : str, optional
        That of a laser tracker's points, where their file states none.
    arm : str, optional
        The robot's arm by its name: poses of controllers' files then get joints where these say how it stands.

    Raises
    ------
    InputError
        If the folder cannot be read, the convention is unknown, or nothing says the unit of a tracker's points.
    ConflictError
        If `out` holds something already, or lies in the folder.
    """
    from calib_core.archive.folder import save_session
    from calib_core.arms.kinematics import arm_of
    from calib_core.poses.numbers import convention_named
    from calib_core.recognition.recognised import recognise
    from calib_core.recognition.session import session_of

    root = Path(folder)
    if convention is not None:
        convention_named(convention)
    if arm is not None:
        arm_of(arm)
    target = _target(root, Path(out) if out is not None else None)
    found = recognise(_given(root), told, convention, sphere_mm, unit, arm)
    open_unit = next((look.file.name for look in found.looks if look.reason.code == "centers-unit"), None)
    if open_unit is not None:
        to_do = message("Write it there, as in X [mm], or tell it by --unit.")
        raise InputError("the unit of the tracker's points", "none in the file", to_do, open_unit)
    made = session_of(found, root.resolve().name, arm)
    target.mkdir(parents=True, exist_ok=True)
    try:
        for copy, name in made.files.items():
            (target / copy).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(root / name, target / copy, follow_symlinks=False)
        save_session(target, _dated(made, root), {})
    except OSError as error:
        with suppress(OSError):
            remove_folder(target)
        got = (error.strerror or type(error).__name__).lower()
        to_do = message("Check its permissions and the disk.")
        raise InputError("a folder that can be written", got, to_do, str(target)) from None
    files = [
        {
            "name": look.file.name,
            "taken_for": look.taken_for,
            "why": look.reason.text,
            "capture": made.capture_of.get(look.file.name),
        }
        for look in found.looks
    ]
    notes = (*made.notes, *(doubt.text for doubt in found.doubts))
    missing = tuple(lack.text for lack in found.missing)
    return NewSession(target, tuple(files), missing, notes, len(made.session.captures))


def _dated(made: "MadeSession", root: Path) -> "Session":
    """Return the session with when each capture's file was written: copies are of today."""
    name_of = {capture: name for name, capture in made.capture_of.items()}
    captures = [
        capture.model_copy(
            update={"taken": text_of_seconds((root / name_of[capture.id]).stat().st_mtime), "clock": "file"}
        )
        if capture.id in name_of
        else capture
        for capture in made.session.captures
    ]
    return made.session.model_copy(update={"captures": captures})


def _target(root: Path, out: Path | None) -> Path:
    """Return where the session goes; raises InputError or ConflictError."""
    if not root.is_dir():
        got = message("a file") if root.exists() else message("no such folder")
        raise InputError("a folder of files", got, "Name the folder they lie in.", str(root))
    real = root.resolve()
    target = out if out is not None else real.parent / f"{real.name}-session"
    to_do = message("Name another by --out.")
    if target.resolve().is_relative_to(real):
        raise ConflictError("a place outside of the folder", str(target), to_do, "--out")
    if os.path.lexists(target) and not (target.is_dir() and not any(target.iterdir())):
        raise ConflictError("a place that holds nothing yet", "something there", to_do, str(target))
    return target


def _given(root: Path) -> list[GivenFile]:
    """Return the files below a folder in their order; the large ones with their beginning alone."""
    from calib_core.recognition.taken import HEAD_BYTES

    given: list[GivenFile] = []
    left = _WHOLE_IN_ALL_BYTES
    for place, folders, names in os.walk(root, followlinks=False):
        folders.sort()
        for name in sorted(names + [name for name in folders if (Path(place) / name).is_symlink()]):
            path = Path(place) / name
            shown = path.relative_to(root).as_posix()
            if path.is_symlink() or not path.is_file():
                given.append(GivenFile(shown, b"", refused="link"))
                continue
            try:
                size = path.stat().st_size
                most = _limit(name, left)
                with path.open("rb") as file:
                    data = file.read(min(size, most) if size <= most else HEAD_BYTES)
            except OSError:
                given.append(GivenFile(shown, b"", refused="unreadable"))
                continue
            left -= len(data)
            given.append(GivenFile(shown, data, size))
        if len(given) > _MOST_FILES:
            to_do = "Name the session's folder."
            raise InputError("at most {most_files} files", "more", to_do, str(root), most_files=_MOST_FILES)
    return _with_digests(root, given)


def _with_digests(root: Path, given: list[GivenFile]) -> list[GivenFile]:
    """Return files with a hash of each of which only the beginning was read, where another begins alike."""
    sizes = Counter((file.size, file.head) for file in given if not file.whole)
    return [
        replace(file, digest=_digest(root / file.name))
        if not file.whole and sizes[file.size, file.head] > 1
        else file
        for file in given
    ]


def _digest(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return b""


def _limit(name: str, left: int) -> int:
    """Return how many bytes of a file are read: a backup whole, of others those that tell what they are."""
    from calib_core.recognition.taken import HEAD_BYTES

    most = 64_000_000 if name.lower().endswith(".zip") else _WHOLE_BYTES
    return most if left > most else HEAD_BYTES
