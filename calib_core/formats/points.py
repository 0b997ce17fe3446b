"""Profiles and clouds from files, byte for byte as the scanner's program wrote them."""

import re
from pathlib import PurePosixPath
from typing import Literal

import numpy as np

from calib_core.errors import InputError, TooLargeError
from calib_core.formats.binary_table import parse_npy
from calib_core.formats.point_files import parse_pcd, parse_ply
from calib_core.formats.text_table import parse_table
from calib_core.frames import FloatArray

MAX_FILE_BYTES = 128_000_000
"""Largest file of a capture; ten million points as float32 fit."""

MAX_PROFILE_BYTES = 32_000_000
"""Largest file of one profile; the longest stripes have some thousand points."""

PROFILE_SUFFIXES = (".csv", ".txt", ".npy")
CLOUD_SUFFIXES = (".ply", ".pcd", ".xyz", ".txt", ".csv", ".npy")

_PROFILE_LINE = "x_mm,z_mm"
_CLOUD_LINE = "x,y,z"


def require_file_size(size_bytes: int, where: str, limit_bytes: int = MAX_FILE_BYTES) -> None:
    """Refuse a file by its size alone, before it is read.

    Raises
    ------
    TooLargeError
    """
    if size_bytes > limit_bytes:
        raise TooLargeError(
            f"a file of at most {limit_bytes / 1e6:.0f} MB",
            f"{size_bytes / 1e6:.0f} MB",
            "Give each capture its own file, without what is not needed.",
            where,
        )


def parse_profile(data: bytes, name: str, may_be_blank: bool = False) -> FloatArray:
    """Return the points of a profile file, (N, 2), x and z in L, without the blanks.

    Parameters
    ----------
    data : bytes
        A table of text ``x_mm,z_mm[,intensity]`` with or without its header (comma, semicolon, tab or spaces), or
        an NPY array (N, 2).
    name : str
        The file's name: its ending says what it is, and messages begin with it.
    may_be_blank : bool
        Whether a profile of blanks alone is one without points, and not an error.

    Raises
    ------
    InputError
        If it is empty, holds no point that came back, no numbers, or another format.
    TooLargeError
        If it is larger than `MAX_PROFILE_BYTES`.
    """
    require_file_size(len(data), name, MAX_PROFILE_BYTES)
    suffix = _suffix(data, name, PROFILE_SUFFIXES, "profile")
    if suffix == ".npy":
        points = parse_npy(data, name, 2)
    else:
        points = parse_table(data, name, [2, 3], _PROFILE_LINE)[:, :2]
    if may_be_blank and not np.isfinite(points).all(axis=1).any():
        return np.empty((0, 2))
    return _finite(points, name, "profile")


def parse_cloud(data: bytes, name: str) -> FloatArray:
    """Return the points of a cloud file, (N, 3) in L, in the file's unit, without the blanks.

    Parameters
    ----------
    data : bytes
        PLY, PCD, a table of text ``x y z …``, or an NPY array (N, 3).
    name : str
        The file's name: its ending says what it is, and messages begin with it.

    Raises
    ------
    InputError
        If it is empty, holds no point that came back, no numbers, is cut off, or has another format.
    TooLargeError
        If it is larger than `MAX_FILE_BYTES`.
    """
    require_file_size(len(data), name)
    suffix = _suffix(data, name, CLOUD_SUFFIXES, "cloud")
    if suffix == ".npy":
        points = parse_npy(data, name, 3)
    elif suffix == ".ply":
        points = parse_ply(data, name)
    elif suffix == ".pcd":
        points = parse_pcd(data, name)
    else:
        points = parse_table(data, name, range(3, 13), _CLOUD_LINE)[:, :3]
    return _finite(points, name, "cloud")


def kind_of_file(data: bytes, name: str) -> Literal["profile", "cloud"]:
    """Return whether a file holds a profile or a cloud, by its ending; NPY, CSV and TXT by their columns too.

    Three columns of a CSV are a profile with intensities, unless its header names y.

    Raises
    ------
    InputError
        If the ending is none of a profile or a cloud.
    """
    suffix = PurePosixPath(name).suffix.lower()
    if suffix == ".npy":
        try:
            parse_npy(data, name, 3)
        except InputError:
            return "profile"
        return "cloud"
    if suffix in (".csv", ".txt"):
        first = data[:200].split(b"\n")[0].decode("latin-1").lower()
        words = re.split(r"[,;\s]+", first.strip())
        if suffix == ".csv":
            return "cloud" if any(word in ("y", "y_mm", '"y"') for word in words) else "profile"
        return "profile" if len(words) == 2 else "cloud"
    if suffix in CLOUD_SUFFIXES:
        return "cloud"
    raise _unknown(name, PROFILE_SUFFIXES + CLOUD_SUFFIXES, "file")


def _suffix(data: bytes, name: str, known: tuple[str, ...], what: str) -> str:
    suffix = PurePosixPath(name).suffix.lower()
    if suffix not in known:
        raise _unknown(name, known, what)
    if not data:
        raise InputError(f"a {what} with points", "an empty file", "Save the capture again.", name)
    return suffix


def _unknown(name: str, known: tuple[str, ...], what: str) -> InputError:
    endings = ", ".join(dict.fromkeys(known))
    return InputError(
        f"a {what} as {endings}",
        PurePosixPath(name).suffix or "no ending",
        "Export it in one of these formats.",
        name,
    )


def _finite(points: FloatArray, name: str, what: str) -> FloatArray:
    kept = points[np.isfinite(points).all(axis=1)]
    if not len(kept):
        raise InputError(
            f"a {what} with points",
            f"{len(points)} blanks: nothing came back to the scanner",
            "Check distance and exposure, and take the capture again; or set its `excluded` to true.",
            name,
        )
    return kept
