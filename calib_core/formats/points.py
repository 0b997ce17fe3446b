"""Profiles and clouds from files as the scanner's program wrote them: which format, and its points."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from calib_core.errors import CalibrationError, InputError, MeasurementError, TooLargeError
from calib_core.formats.format import Format, Kind, Match, PointKind, Reading, Settings, ending_of, require_kind
from calib_core.frames import FloatArray
from calib_core.messages import message, templates
from calib_core.records.field_errors import input_error
from calib_core.registry import Registry

FORMATS: Registry[Format] = Registry("a file format", "calib_core.formats", "FORMAT", Format, "scancell.formats")

MAX_FILE_BYTES = 128_000_000
"""Largest file of a capture; ten million points as float32 fit."""

MAX_PROFILE_BYTES = 32_000_000
"""Largest file of one profile; the longest stripes have some thousand points."""

_LEAST_MM, _MOST_MM = {"profile": 1.0, "cloud": 5.0}, 10_000.0
_MANY = 50_000  # points that tell how large a cloud is


def endings_of(*kinds: Kind) -> tuple[str, ...]:
    """Return the endings of the files that can hold one of these kinds, of all where none is given."""
    chosen = [entry for entry in FORMATS if not kinds or set(kinds) & set(entry.kinds)]
    return tuple(dict.fromkeys(ending for entry in chosen for ending in entry.endings))


def usual_kind(name: str) -> Kind | None:
    """Return what a file with this ending usually holds; None for an ending that no format has."""
    likeliest = max(FORMATS, key=lambda entry: entry.recognise(b"", name).sure)
    return likeliest.kinds[0] if likeliest.recognise(b"", name).sure else None


_AS = templates({
    "file": "a file as {endings}",
    "profile": "a profile as {endings}",
    "cloud": "a cloud as {endings}",
    "frame": "an image as {endings}",
    "mesh": "a mesh as {endings}",
})  # fmt: skip
_WITH_POINTS = templates({
    "file": "a file with points",
    "profile": "a profile with points",
    "cloud": "a cloud with points",
})  # fmt: skip


def recognise(data: bytes, name: str, kind: Kind | None = None) -> tuple[Format, Match]:
    """Return the format that a file most probably has, and why; raises InputError where none claims it."""
    entries = [entry for entry in FORMATS if kind is None or kind in entry.kinds]
    found = [(entry, entry.recognise(data, name)) for entry in entries]
    entry, match = max(found, key=lambda each: each[1].sure)
    if not match.sure:
        endings = ", ".join(endings_of(kind) if kind else endings_of())
        to_do = message("Export it in one of these formats.")
        need = _AS.get(kind or "file", _AS["file"])
        raise InputError(need, ending_of(name) or "no ending", to_do, name, endings=endings)
    return entry, match


def read_file(
    data: bytes,
    name: str,
    kind: PointKind | None = None,
    format_name: str | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Reading:
    """Return the points of a file, and what was taken for what.

    Parameters
    ----------
    data : bytes
    name : str
        The file's name: its ending helps to know the format, and messages begin with it.
    kind : "profile" or "cloud", optional
        What is needed; where it is left out the file decides.
    format_name : str, optional
        The format; where it is left out it is recognised.
    settings : mapping, optional
        What the user says about the file, by the format's own schema.

    Raises
    ------
    InputError
        If it is empty or cut off, holds no numbers, or columns that do not fit.
    TooLargeError
        If it is larger than `MAX_FILE_BYTES`, a profile than `MAX_PROFILE_BYTES`.
    """
    require_file_size(len(data), name, MAX_PROFILE_BYTES if kind == "profile" else MAX_FILE_BYTES)
    entry = FORMATS.get(format_name, name) if format_name else recognise(data, name, kind)[0]
    if not data:
        to_do = "Copy or export it again."
        raise InputError(_WITH_POINTS[kind or "file"], "an empty file", to_do, name)
    if entry.read is None:
        to_do = "Export its points."
        raise InputError(_WITH_POINTS["file"], "a file of the format '{entry}'", to_do, name, entry=entry.name)
    told = _settings(entry, settings or {}, name)
    try:
        reading = entry.read(data, name, told, kind)
    except CalibrationError:
        raise
    except Exception as error:  # a reader of another package: its fault must not look like one of the file alone
        if not entry.read.__module__.startswith("calib_core."):
            got = f"{type(error).__name__}: {error}"[:200]
            to_do = "Tell the makers of that format."
            raise InputError("a file of the format '{entry}'", got, to_do, name, entry=entry.name) from error
        raise
    require_kind(reading.kind, kind, name, message("the axes {axes}", axes=", ".join(reading.axes)))
    reading = reading.scaled(told)
    return replace(reading, format=entry.name, doubts=(*reading.doubts, *_doubts_of_size(reading)))


def parse_profile(data: bytes, name: str, may_be_blank: bool = False) -> FloatArray:
    """Return the points of a profile file, (N, 2), x and z in L in mm, without the blanks.

    Parameters
    ----------
    data : bytes
    name : str
        The file's name.
    may_be_blank : bool
        Whether a profile of blanks alone is one without points, and not an error.

    Raises
    ------
    InputError
        If it is empty, holds no numbers, or another format.
    MeasurementError
        If it holds no point that came back.
    TooLargeError
        If it is larger than `MAX_PROFILE_BYTES`.
    """
    reading = read_file(data, name, "profile")
    return known_points(reading, name) if not may_be_blank or reading.known.any() else np.empty((0, 2))


def parse_cloud(data: bytes, name: str) -> FloatArray:
    """Return the points of a cloud file, (N, 3) in L in mm, without the blanks; raises as `read_file`."""
    return known_points(read_file(data, name, "cloud"), name)


def known_points(reading: Reading, where: str) -> FloatArray:
    """Return the points of a reading without the blanks; raises MeasurementError where nothing came back."""
    kept = reading.points if reading.known.all() else reading.points[reading.known]
    if not len(kept):
        got = message("none: nothing came back to the scanner")
        if len(reading.points):
            got = message("{count} blanks: nothing came back to the scanner", count=len(reading.points))
        to_do = "Check distance and exposure, and take the capture again; or set its `excluded` to true."
        raise MeasurementError("a {kind} with points", got, to_do, where, kind=reading.kind)
    return kept


def require_file_size(size_bytes: int, where: str, limit_bytes: int = MAX_FILE_BYTES) -> None:
    """Refuse a file by its size alone, before it is read.

    Raises
    ------
    TooLargeError
    """
    if size_bytes > limit_bytes:
        raise TooLargeError(
            "a file of at most {limit_mb:g} MB",
            "{size_mb:.0f} MB",
            "Give each capture its own file, without what is not needed.",
            where,
            limit_mb=limit_bytes / 1e6,
            size_mb=size_bytes / 1e6,
        )


def _settings(entry: Format, told: Mapping[str, Any], where: str) -> Settings:
    try:
        return entry.settings.model_validate(dict(told))
    except ValidationError as error:
        raise input_error(
            error, told, message("{place}: format_settings of '{entry}'", place=where, entry=entry.name)
        ) from None


def _doubts_of_size(reading: Reading) -> list[str]:
    """Return a doubt where nobody states the unit and the points are smaller or larger than scanners see."""
    if reading.unit_from != "assumed" or len(reading.points) < 3:
        return []
    some = reading.points[:: max(1, len(reading.points) // _MANY)]
    extent_mm = float(np.linalg.norm(np.fmax.reduce(some) - np.fmin.reduce(some)))
    if 0 < extent_mm < _LEAST_MM[reading.kind]:
        return [
            message(
                "All points lie within {extent_mm:.3g} mm: they look like metres. If they are, give the unit m.",
                extent_mm=extent_mm,
            )
        ]
    if extent_mm > _MOST_MM:
        return [
            message(
                "The points span {extent_mm:.3g} m: they look like micrometres. If they are, give the unit um.",
                extent_mm=extent_mm / 1000,
            )
        ]
    return []
