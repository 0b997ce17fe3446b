"""Paths of more than 260 characters: refused here as on Windows, but in the form in which Windows takes them."""

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest

from calib_core import disk
from server import cli
from server.console import output
from server.console.output import STANDARD_INPUT, take_long_paths
from server.sources.frame_folder import FrameFolder, FrameFolderSettings

_MOST = 259
_LOOKED_AT = {"open", "os.mkdir", "os.scandir", "os.listdir", "os.rename", "os.remove"}
_refused: list[bool] = []


def _look(event: str, arguments: tuple[object, ...]) -> None:
    if _refused and event in _LOOKED_AT:
        for name in arguments[:2]:
            if isinstance(name, str) and len(os.path.abspath(name)) > _MOST:  # noqa: PTH100
                raise FileNotFoundError(206, "Windows opens no such path", name)


sys.addaudithook(_look)


@pytest.fixture
def long(tmp_path: Path) -> Iterator[Path]:
    """A folder with a long path, which is short in its extended form; others are refused."""
    place = tmp_path.joinpath(*["a long name of a folder in which nobody finds anything again"] * 5)
    place.mkdir(parents=True)
    (short := tmp_path / "s").symlink_to(place)
    whole = str(place)

    def extended(path: Path, _room: int = 0) -> Path:
        name = os.path.abspath(path)  # noqa: PTH100
        return Path(str(short) + name.removeprefix(whole)) if name.startswith(whole) else path

    with patch.object(output, "extended", extended), patch.object(cli, "WINDOWS", True):
        _refused.append(True)
        yield place
        _refused.clear()


@pytest.mark.thorough
def test_commands_read_and_write_what_has_a_long_path(solved_folder: Path, long: Path) -> None:
    cell = str(long / "cell")
    for words in (
        ["simulate", "tcp", "--seed", "3", "--out", cell],
        ["check", cell],
        ["run", cell],
        ["report", cell, "--out", str(long / "report.html")],
        ["archive", "pack", cell, "--no-scene", "--out", str(long / "cell.zip")],
        ["archive", "verify", str(long / "cell.zip")],
        ["archive", "unpack", str(long / "cell.zip"), "--out", str(long / "unpacked")],
        ["board", str(long / "board.svg"), "--kind", "chessboard"],
    ):
        assert cli.main([*words, "--quiet"]) == 0, words
    unpacked = "unpacked/data/session.json"
    with pytest.raises(FileNotFoundError, match="Windows opens no such path"):
        (long / unpacked).open()
    assert (long.parents[4] / "s" / unpacked).is_file()


def test_what_is_no_path_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "extended", lambda path, _room: path / "extended")
    options = argparse.Namespace(out=STANDARD_INPUT, file=Path("NUL"), sessions=[Path("a"), 1], name="b")
    take_long_paths(options)
    assert vars(options) == {
        "out": STANDARD_INPUT,
        "file": Path("NUL"),
        "sessions": [Path("a/extended"), 1],
        "name": "b",
    }


def test_folders_that_are_watched_are_long_already(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows would find files below them, and not open them."""
    from server.sources import frame_folder

    asked: list[int] = []
    monkeypatch.setattr(frame_folder, "extended", lambda path, room: asked.append(room) or path)
    FrameFolder(FrameFolderSettings(folder=tmp_path))
    assert asked == [disk.LONGEST_PLAIN]
