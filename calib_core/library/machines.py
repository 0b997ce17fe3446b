"""Machines' files from Python: poses out of a controller's, the tool as it stands in one."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from calib_core.errors import InputError
from calib_core.messages import message

if TYPE_CHECKING:
    from calib_core.robots.controller_file import ControllerFile

_LARGEST_BYTES = 256_000_000


def read_poses(
    *paths: str | Path, brand: str | None = None, as_written: bool = False, told: Mapping[str, str] | None = None
) -> "ControllerFile":
    """Return poses, tools and frames of a controller's files, and what was skipped, as `scancell poses` prints it.

    Parameters
    ----------
    *paths : str or Path
        Programs, data lists, folders or zips of a backup; they are read together.
    brand : str, optional
        The controller's brand, where the files do not tell it.
    as_written : bool
        Take poses as they stand, where the tool or frame they were taught with is not in the files.
    told : mapping, optional
        What the files do not say: convention, unit, columns, topic, base, flange, arm.

    Raises
    ------
    InputError
        If no file is of a known brand, or what is told is unknown.
    """
    from calib_core.recognition.tracker_points import file_of_tracker
    from calib_core.robots.backup import read_controller_files
    from calib_core.robots.file_hints import Told

    files: dict[str, bytes] = {}
    for path in paths:
        files |= files_of(Path(path))
    try:
        return read_controller_files(files, brand, as_written, Told.of(told or {}))
    except InputError:
        if (name := file_of_tracker(files)) is None:
            raise
        to_do = message("Lay it beside the robot's poses in a folder, and make a session of both: scancell new.")
        raise InputError("a robot's poses", "a laser tracker's points", to_do, name) from None


def files_of(path: Path) -> dict[str, bytes]:
    """Return a file, or all files of a folder, by their names.

    Raises
    ------
    InputError
        If it cannot be read, or holds more than a backup does.
    """
    try:
        if path.is_dir():
            names = sorted(p for p in path.rglob("*") if p.is_file())
            if sum(p.stat().st_size for p in names) > _LARGEST_BYTES:
                to_do = message("Give the files with programs, tools and frames alone.")
                need = "a file of at most {limit_mb:g} MB"
                raise InputError(need, "a larger one", to_do, str(path), limit_mb=_LARGEST_BYTES / 1e6)
            return {p.relative_to(path).as_posix(): p.read_bytes() for p in names}
        return {path.name: path.read_bytes()}
    except OSError as error:
        got = (error.strerror or type(error).__name__).lower()
        raise InputError("a file that can be read", got, "Check the path.", str(path)) from None
