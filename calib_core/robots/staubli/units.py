"""Stäubli VAL 3: the unit of lengths, which the project file (.pjx) states for the data beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from calib_core.errors import InputError
from calib_core.formats.shared.xml_file import Element
from calib_core.messages import message
from calib_core.robots.controller_file import Found

_MM_PER_INCH = 25.4
_STATED = {"true": 1.0, "1": 1.0, "false": _MM_PER_INCH, "0": _MM_PER_INCH}
_INCHES = b'millimeterUnit="false"'


def unit_of(element: Element) -> float | None:
    """Return the mm of a unit of length, where an element of a project file says it."""
    return _STATED.get(element.attributes.get("millimeterUnit", "").strip().lower())


def in_millimetres(found: Sequence[Found]) -> list[Found]:
    """Return what files hold, lengths in mm by the unit of the project file in their folder.

    Data without one are taken in millimetres, and a note says so.

    Raises
    ------
    InputError
        If project files of different units stand beside data of neither's name.
    """
    projects = [part for part in found if part.mm_per_unit]
    return [_scaled(part, _project_of(part, projects)) if _has_lengths(part) else part for part in found]


def require_millimetres(files: Mapping[str, bytes]) -> None:
    """Raise InputError if an application that a tool is put into counts in inches."""
    for name, data in files.items():
        if name.lower().endswith(".pjx") and _INCHES in data:
            to_do = message(
                "Change the application to millimetres in the controller and save it anew, or export a .dtx alone."
            )
            need = "an application in millimetres"
            raise InputError(need, "one in inches (millimeterUnit is false)", to_do, name)


def _path(part: Found) -> PurePosixPath:
    return PurePosixPath(part.file.replace("\\", "/").lower())


def _project_of(part: Found, projects: Sequence[Found]) -> Found | None:
    """Return the project file that states a file's unit: the one of its name, else what its folder agrees on."""
    beside = [one for one in projects if _path(one).parent == _path(part).parent]
    own = [one for one in beside if _path(one).stem == _path(part).stem] or beside
    if len({one.mm_per_unit for one in own}) > 1:
        got = message("{projects}: some in mm, some in inches", projects=", ".join(one.file for one in own[:5]))
        raise InputError("project files (.pjx) of one unit", got, "Read each application alone.", part.file)
    return own[0] if own else None


def _has_lengths(part: Found) -> bool:
    return bool(part.tools or part.frames or any(taught.numbers for taught in part.poses))


def _scaled(part: Found, project: Found | None) -> Found:
    if project is None:
        said = message(
            "{file}: no project file (.pjx) beside it states the unit of lengths; millimetres are taken.",
            file=part.file,
        )
        return replace(part, notes=[*part.notes, said])
    if (unit := project.mm_per_unit or 1.0) == 1.0:
        return part
    said = message(
        "{file} is in inches, as {project} states: lengths were converted to millimetres.",
        file=part.file,
        project=project.file,
    )
    return replace(
        part,
        poses=[replace(one, numbers=one.numbers and _in_mm(one.numbers, unit)) for one in part.poses],
        tools=[replace(one, pose=_in_mm(one.pose, unit)) for one in part.tools],
        frames=[replace(one, pose=_in_mm(one.pose, unit)) for one in part.frames],
        notes=[*part.notes, said],
    )


def _in_mm(pose: tuple[float, ...], mm_per_unit: float) -> tuple[float, ...]:
    return (*(mm_per_unit * v for v in pose[:3]), *pose[3:])
