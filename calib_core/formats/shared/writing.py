"""Files that appear whole or not at all; tables and triangles as writers take them."""

import errno
import os
import tempfile
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, islice
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.disk import extended, remove_file, replace_file
from calib_core.errors import InputError
from calib_core.messages import message, plural

XYZ = ("x", "y", "z")

FAR_MM = 16_384.0
"""Farther from zero, single precision errs by more than a micrometre."""

BLOCK = 50_000
_LARGE = 1 << 20
_NAME_KEPT = 100
"""Of a name in that of the temporary file: a name may be as long as the file system allows."""


def write_pieces(path: Path, pieces: Iterable[bytes | memoryview]) -> int:
    """Write a file beside its name, then rename it; return its size in bytes.

    What stood under the name stays whole unless all was written.

    Raises
    ------
    InputError
        If the disk is full or the folder cannot be written, or no plain file stands under the name; nothing is
        left behind.
    """
    size = 0
    with replacing(path, durable=False) as file:
        for step in _in_large_steps(pieces):
            length = sum(len(piece) for piece in step)
            if size or length >= _LARGE:
                _reserve(file.fileno(), size, length)
            for piece in step:
                size += _write_all(file.fileno(), piece)
    return size


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that a failure, a power cut too, leaves the old one whole; raises InputError."""
    with replacing(path) as file:
        file.write(content)


@contextmanager
def replacing(path: Path, durable: bool = True) -> Generator[IO[bytes]]:
    """Give a new file that takes the place of what stands under a name once all of it was written.

    `durable` waits until the disk has it, so that a power cut leaves either all of it or what was there before.

    Raises
    ------
    InputError
        If the disk is full or the folder cannot be written, or no plain file stands under the name; nothing is
        left behind.
    """
    path = extended(path, _NAME_KEPT)
    require_replaceable(path)
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:_NAME_KEPT]}.")
        temporary = Path(name)
        with os.fdopen(handle, "w+b") as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.chmod(0o644)
        replace_file(temporary, path)
    except OSError as error:
        _remove(temporary)
        got = error.strerror or type(error).__name__
        to_do = message("Make room there, or name another folder.")
        raise InputError("a place to write to", got, to_do, str(path)) from None
    except BaseException:
        _remove(temporary)
        raise


def require_replaceable(path: Path) -> None:
    """Refuse a name under which something stands that is no plain file: a link, a device, a pipe, a folder.

    Raises
    ------
    InputError
    """
    if path.is_symlink():
        to_do = message("Name the file that it leads to, or another; - is standard output.")
        raise InputError("a file or a new name", "a link, which is not replaced", to_do, str(path))
    if path.exists() and not path.is_file():
        got = "a folder" if path.is_dir() else "a device or the like"
        to_do = "Name another."
        raise InputError("a file or a new name", "{found}, which is not replaced", to_do, str(path), found=got)


def _in_large_steps(pieces: Iterable[bytes | memoryview]) -> Iterator[list[bytes | memoryview]]:
    """Give pieces together until they are large, so that a header does not go alone."""
    step: list[bytes | memoryview] = []
    for piece in pieces:
        step.append(piece)
        if sum(len(one) for one in step) >= _LARGE:
            yield step
            step = []
    if step:
        yield step


def _reserve(handle: int, start: int, length: int) -> None:
    """Reserve room: a full disk is known at once, and renaming need not wait until the disk has found the room."""
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(handle, start, length)
        except OSError as error:
            if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
                raise


def _write_all(handle: int, piece: bytes | memoryview) -> int:
    rest = memoryview(piece)
    while len(rest):
        rest = rest[os.write(handle, rest) :]
    return len(piece)


def _remove(path: Path | None) -> None:
    if path is not None:
        with suppress(OSError):
            remove_file(path)


def number_type(values: NDArray[np.floating]) -> str:
    """Return the type that holds points (N, 3 or more): "<f8" for double precision far from zero, else "<f4"."""
    double = values.dtype == np.float64 and len(values) and np.abs(values[:, :3]).max() > FAR_MM
    return "<f8" if double else "<f4"


def in_one_type(tables: Iterable[ArrayLike], names: tuple[str, ...]) -> tuple[str, Iterator[NDArray[np.floating]]]:
    """Return the type that the first table needs, and all of them in it; raises InputError as `table_of`."""
    rest = iter(tables)
    first = [np.asarray(table) for table in islice(rest, 1)]
    kind = number_type(first[0]) if first and first[0].ndim == 2 else "<f4"
    return kind, (table_of(table, names, kind) for table in chain(first, rest))


def table_of(values: ArrayLike, names: tuple[str, ...], kind: str = "<f4") -> NDArray[np.floating]:
    """Return points as a table (N, K); raises InputError where there are none or names do not fit."""
    table = np.ascontiguousarray(values, dtype=kind)
    if table.ndim != 2 or not len(table):
        to_do = "Merge scans first."
        raise InputError("at least one point to write", "an array of shape {shape}", to_do, shape=table.shape)
    if table.shape[1] != len(names) or names[:3] != XYZ:
        raise InputError(
            plural(
                "{count} column ({names})",
                "{count} columns ({names})",
                by="count",
                count=len(names),
                names=" ".join(names),
            ),
            f"{table.shape[1]}",
            "Name each column.",
        )
    return table


def faces_of(triangles: ArrayLike, points: int) -> NDArray[np.int32]:
    """Return triangles (M, 3); raises InputError where there are none or one names a point that is not there."""
    faces = np.asarray(triangles)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        to_do = "Mesh the cloud first."
        raise InputError("triangles of three corners", "an array of shape {shape}", to_do, shape=faces.shape)
    if faces.min() < 0 or faces.max() >= points:
        need = "corners among {points} points"
        to_do = "Give mesh and points together."
        raise InputError(need, "number {faces}", to_do, points=points, faces=faces.max())
    return faces.astype("<i4")
