"""Files that the program which writes them, or a virus scanner, still holds: taken later, never given up."""

import os
import time
from pathlib import Path
from typing import Any

import pytest

from calib_core.disk import is_held, is_system_file
from calib_core.library.machines import files_of
from server.sources import folder_watcher
from server.sources.folder import files_in
from server.sources.frame_folder import FrameFolder, FrameFolderSettings
from tests.server.test_watched_folder import (
    client,  # noqa: F401 (fixture)
    folder,  # noqa: F401 (fixture)
    pose_line,
    profile,
    wait_for_captures,
    watched_session,
)


class Holder:
    """Refuses that a file is opened, as Windows does while another program has it for itself."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
        self.name, self.asked, self.holds = name, 0, True
        opened = os.open

        def opening(path: Any, *rest: Any, **more: Any) -> int:
            if self.holds and Path(os.fsdecode(path)).name == name:
                self.asked += 1
                error = PermissionError(13, "The process cannot access the file", name)
                error.winerror = 32  # type: ignore[attr-defined]
                raise error
            return opened(path, *rest, **more)

        monkeypatch.setattr(os, "open", opening)


def test_what_is_held_passes_and_what_is_forbidden_does_not() -> None:
    held, forbidden = PermissionError(13, "held"), PermissionError(13, "forbidden")
    held.winerror = 33  # type: ignore[attr-defined]
    assert is_held(held)
    assert not is_held(forbidden)
    assert not is_held(FileNotFoundError(2, "none"))


def test_a_watched_file_that_is_held_is_taken_when_it_is_let_go(
    client: Any,  # noqa: F811
    folder: Path,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    holder = Holder(monkeypatch, "a.csv")
    session = watched_session(client)
    (folder / "a.txt").write_text(pose_line(0), encoding="utf-8")
    (folder / "a.csv").write_bytes(profile(0))
    until_s = time.monotonic() + 20
    while holder.asked < 2:
        assert time.monotonic() < until_s, client.get(f"/sessions/{session}/sources/folder").text
        time.sleep(0.02)
    watch = client.get(f"/sessions/{session}/sources/folder").json()["watch"]
    assert (watch["taken"], watch["refused"]) == (0, [])
    holder.holds = False
    assert len(wait_for_captures(client, session, 1)) == 1


def test_a_live_frame_that_is_held_is_read_when_it_is_let_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = FrameFolder(FrameFolderSettings(folder=tmp_path))
    (tmp_path / "f.csv").write_bytes(b"0,200\n")
    read, refused = Path.read_bytes, [32, 5]

    def reading(path: Path) -> bytes:
        if refused:
            error = PermissionError(13, "The process cannot access the file", str(path))
            error.winerror = refused.pop()  # type: ignore[attr-defined]
            raise error
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", reading)
    assert frames.read() is None
    assert frames.read() is None
    frame = frames.read()
    assert frame is not None
    assert (frame.name, frame.content) == ("f.csv", b"0,200\n")


@pytest.mark.thorough
def test_a_file_that_is_listed_with_an_earlier_size_is_taken_when_it_is_closed(
    client: Any,  # noqa: F811
    folder: Path,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Windows' list of a folder does not see a file grow until it is closed."""
    is_open, looked = [True], [0]

    def listed(place: Path) -> dict[str, tuple[int, int]]:
        found = files_in(place)
        looked[0] += 1
        return found | {"a.csv": (100, 1)} if is_open and "a.csv" in found else found

    monkeypatch.setattr(folder_watcher, "files_in", listed)
    session = watched_session(client)
    (folder / "a.txt").write_text(pose_line(0), encoding="utf-8")
    (folder / "a.csv").write_bytes(profile(0))
    until_s = time.monotonic() + 60
    while looked[0] < 12:
        assert time.monotonic() < until_s
        time.sleep(0.05)
    assert client.get(f"/sessions/{session}/captures").json()["items"] == []
    is_open.clear()
    assert len(wait_for_captures(client, session, 1, 60)) == 1


def test_a_live_file_that_is_listed_with_an_earlier_size_is_read_when_it_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = FrameFolder(FrameFolderSettings(folder=tmp_path))
    monkeypatch.setattr(FrameFolder, "_whole", lambda _: {"1.csv": (1, 1)})
    (tmp_path / "1.csv").write_bytes(b"0,200\n")
    assert frames.read() is None
    monkeypatch.undo()
    frame = next(frame for _ in range(10) if (frame := frames.read()) is not None)
    assert frame.content == b"0,200\n"


@pytest.mark.parametrize("name", ["Thumbs.db", "scans/desktop.ini", "DESKTOP.INI", "~$poses.xlsx"])
def test_what_windows_itself_puts_into_folders_is_no_measurement(tmp_path: Path, name: str) -> None:
    assert is_system_file(name)
    (tmp_path / name.rpartition("/")[2]).write_bytes(b"1")
    assert files_in(tmp_path) == {}


def test_files_of_a_backup_are_named_alike_on_all_systems(tmp_path: Path) -> None:
    (tmp_path / "KRC" / "R1").mkdir(parents=True)
    (tmp_path / "KRC" / "R1" / "$config.dat").write_bytes(b"")
    assert list(files_of(tmp_path)) == ["KRC/R1/$config.dat"]
