"""What a command prints: its result for people or programs, and remarks beside it."""

import argparse
import io
import json
import os
import shutil
import stat
import sys
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from glob import glob
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from calib_core.disk import WINDOWS, extended, temporary_folder
from calib_core.errors import InputError
from calib_core.messages import message
from server.console.language import lines_said

STANDARD_OUTPUT = STANDARD_INPUT = Path("-")
_SPOOLED = "standard input"
_ROOM = 80  # for names below a folder that is named; what a data folder has below is no longer


class _Asked(Protocol):
    """A capture that is asked for."""

    axes_deg: dict[str, float] | None
    axes_mm: dict[str, float] | None
    scanner: str | None


def take_any_text() -> None:
    """Let the standard streams take every text: UTF-8 in files and pipes, and in a terminal what it can show.

    Windows gives them the code page of the country, which lacks ≥ and 中; a program without a console has none.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115 (stays open)
        elif isinstance(stream, io.TextIOWrapper):
            shown = stream.isatty() or "PYTHONIOENCODING" in os.environ
            with suppress(OSError):  # its file was exchanged for a pipe: it is changed all the same
                stream.reconfigure(encoding=None if shown else "utf-8", errors="backslashreplace")


def with_matches(words: Sequence[str]) -> list[str]:
    """Return arguments with files in place of `*.csv` and the like, as shells elsewhere than on Windows do."""
    found: list[str] = []
    for word in words:
        matches = sorted(glob(word)) if {"*", "?"} & set(word) and word[0] != "-" else []  # noqa: PTH207 (as text)
        found += matches or [word]
    return found


def take_long_paths(options: argparse.Namespace) -> None:
    """Have every path of the arguments that is too long for Windows named as Windows takes it."""
    for name, value in vars(options).items():
        if isinstance(value, Path):
            setattr(options, name, _whole(value))
        elif isinstance(value, list):
            setattr(options, name, [_whole(one) if isinstance(one, Path) else one for one in value])


def _whole(path: Path) -> Path:
    return path if path == STANDARD_INPUT or path.name.lower() == "nul" else extended(path, _ROOM)


def print_result(options: argparse.Namespace, text: str, data: Any) -> None:
    """Print what a command found: one JSON object with --json, else text; nothing with --quiet alone."""
    if options.json:
        print(json.dumps(data, ensure_ascii=False, allow_nan=False), flush=True)
    elif not options.quiet:
        print(lines_said(options, text), flush=True)


def read_object(file: Path) -> dict[str, Any]:
    """Return a cell that is described in a file; raises InputError where it is no JSON object."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError("a cell as JSON", str(error), "Give another file, or options alone.", str(file)) from None
    if not isinstance(data, dict):
        raise InputError("a JSON object", type(data).__name__, "See docs/guidance.md.", str(file))
    return data


def remark(options: argparse.Namespace, sentence: str) -> None:
    """Say something on standard error, unless --quiet."""
    if not options.quiet:
        print(f"scancell: {lines_said(options, sentence)}", file=sys.stderr)


def write_out(options: argparse.Namespace, out: Path, pieces: Iterable[bytes | memoryview]) -> None:
    """Write a command's file to where --out says: a file, whole or not at all; `-`; a pipe.

    Raises
    ------
    InputError
        If it cannot be written there; or `-` is a terminal that cannot show it, or wanted for JSON.
    """
    from calib_core.formats.shared.writing import write_pieces

    if out == STANDARD_OUTPUT:
        if options.json:
            raise InputError("a file beside --json", "standard output for both", "Add --out FILE.", "--out")
        _stream(sys.stdout.buffer, pieces)
        return
    if is_stream(out):
        with out.open("wb") as file:
            _stream(file, pieces)
    else:
        write_pieces(out, pieces)
    print_result(options, str(out), {"file": str(out)})


def is_stream(out: Path) -> bool:
    """Return whether --out names what is written into and never replaced: standard output, a pipe, a terminal."""
    if out == STANDARD_OUTPUT or (WINDOWS and out.name.lower() == "nul"):
        return True
    try:
        mode = out.stat().st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)


def _stream(file: BinaryIO, pieces: Iterable[bytes | memoryview]) -> None:
    for piece in pieces:
        file.write(piece)
    file.flush()


def input_name(path: Path) -> str:
    """Return how people are told of a file that is read, which may be what came on standard input."""
    return message("standard input") if path.name == _SPOOLED else str(path)


@contextmanager
def from_standard_input(options: argparse.Namespace) -> Generator[None]:
    """Put what stands on standard input into a file for as long as a command runs whose input is `-`.

    Raises
    ------
    InputError
        If standard input is a terminal.
    """
    asked = [name for name in ("session", "file") if getattr(options, name, None) == STANDARD_INPUT]
    if not asked:
        yield
        return
    from calib_core.errors import CalibrationError, InputError

    if sys.stdin is None or sys.stdin.isatty():
        raise InputError("data on standard input", "a terminal", "Redirect a file or a pipe to it.", "-")
    with temporary_folder() as folder:
        file = folder / _SPOOLED
        with file.open("wb") as spooled:
            shutil.copyfileobj(sys.stdin.buffer, spooled)
        setattr(options, asked[0], file)
        try:
            yield
        except CalibrationError as error:
            place = error.where.replace(str(file), _SPOOLED)
            raise type(error)(error.need, error.got, error.to_do, place) from None


def where_axes(asked: _Asked) -> str:
    """Return where named axes are to stand, and whose capture it is; empty where the cell names none."""
    turns = "".join(f"  {name} {value:.1f}°" for name, value in (asked.axes_deg or {}).items())
    shifts = "".join(f"  {name} {value:.1f} mm" for name, value in (asked.axes_mm or {}).items())
    return turns + shifts + (f"  ({asked.scanner})" if asked.scanner else "")
