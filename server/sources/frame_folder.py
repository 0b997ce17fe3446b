"""A folder that a scanner's own program writes exposures into, as a live stream: its newest whole files."""

import os
import time
from pathlib import Path

from pydantic import Field

from calib_core.disk import LONGEST_PLAIN, extended, is_held
from calib_core.errors import InputError
from server.sources.device import Description, Frame, host_now_s
from server.sources.source import Settings, Source

_LOOK_EVERY_S = 0.02
_WAIT_S = 0.5


class FrameFolderSettings(Settings):
    """The folder, as this server sees it, and the ending of its files."""

    folder: Path
    ending: str = Field(default=".csv", pattern=r"^\.[A-Za-z0-9]{1,8}$")


class FrameFolder:
    """Reads files in the order of their names' appearance, each once, when its size rests between two looks."""

    def __init__(self, settings: FrameFolderSettings) -> None:
        self._folder = extended(settings.folder, LONGEST_PLAIN)
        if not self._folder.is_dir():
            raise InputError("a folder", "none", "Check the path.", str(settings.folder))
        self._ending = settings.ending.lower()
        self._seen = self._whole()
        self._growing: dict[str, tuple[int, int]] = {}
        self._ready: list[str] = []

    def describe(self) -> Description:
        """Return that it delivers files."""
        return Description(f"folder {self._folder.name}", can=("profiles", "images"))

    def read(self) -> Frame | None:
        """Return the next file that is whole; raises OSError where the folder is gone."""
        until_s = time.monotonic() + _WAIT_S
        while not self._ready:
            self._look()
            if self._ready:
                break
            if time.monotonic() > until_s:
                return None
            time.sleep(_LOOK_EVERY_S)
        name = self._ready.pop(0)
        path = self._folder / name
        try:
            changed_s, content = path.stat().st_mtime, path.read_bytes()
        except FileNotFoundError:  # its writer keeps the newest ones only
            return None
        except OSError as error:
            if not is_held(error):
                raise
            self._ready.insert(0, name)
            time.sleep(_LOOK_EVERY_S)
            return None
        if (
            len(content) != self._seen.get(name, (len(content),))[0]
        ):  # Windows lists a size of before until it is closed
            del self._seen[name]
            return None
        return Frame(host_now_s(), name, content, changed_s)

    def close(self) -> None:
        """Keep nothing."""
        self._ready.clear()

    def _look(self) -> None:
        now = self._whole()
        fresh = {name: signature for name, signature in now.items() if self._seen.get(name) != signature}
        done = [name for name, signature in fresh.items() if self._growing.get(name) == signature]
        self._ready = sorted(done, key=lambda name: (fresh[name][1], name))
        self._seen = {name: signature for name, signature in now.items() if name in done or name in self._seen}
        self._growing = fresh

    def _whole(self) -> dict[str, tuple[int, int]]:
        found: dict[str, tuple[int, int]] = {}
        with os.scandir(self._folder) as entries:
            for entry in entries:
                if entry.name.startswith(".") or not entry.name.lower().endswith(self._ending):
                    continue
                try:
                    status = entry.stat(follow_symlinks=False)
                except FileNotFoundError:
                    continue
                if status.st_size:
                    found[entry.name] = status.st_size, status.st_mtime_ns
        return found


SOURCE = Source(
    "frame-folder",
    "Folder of exposures",
    "Reads the files that a scanner's or camera's own program writes, as a live stream.",
    FrameFolderSettings,
    connect=FrameFolder,
    delivers=("scanner",),
    is_asked=True,
)
