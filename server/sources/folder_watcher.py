"""Watches folders for sessions: one thread looks at all of them, a few times a second.

Looking is chosen over being told by the system: folders on network shares, where scanners write, tell nothing.
What is watched and what was taken is kept in a file of the data folder, so that a restart neither forgets nor
repeats.
"""

import json
import logging
import os
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib_core.disk import LONGEST_PLAIN, extended, is_held, replace_file
from calib_core.errors import CalibrationError, ConflictError, InputError, NotFoundError, TooLargeError
from calib_core.messages import message
from calib_core.records import Capture, Session, StepName
from server.background import BackgroundThread
from server.sources.folder import Resting, Signature, capture_of, files_in, measurements, notes_of

log = logging.getLogger("scancell")

_MOST_FOLDERS = 200

Load = Callable[[str], tuple[Session, set[str]]]
"""Gives a session's record without captures and the ids of its captures; raises NotFoundError."""
Take = Callable[[str, Capture, Mapping[str, bytes]], None]
"""Stores a capture; raises CalibrationError."""


@dataclass
class WatchedFolder:
    """A session's folder: what was taken of it, and why other files are not.

    `refused` maps names to the signatures and sentence of a refusal: it is looked at again once a file changes.
    """

    folder: str
    step: StepName
    taken: dict[str, Signature] = field(default_factory=dict[str, Signature])
    refused: dict[str, tuple[list[Signature], str]] = field(default_factory=dict[str, tuple[list[Signature], str]])
    waiting: list[str] = field(default_factory=list[str])
    problem: str = ""
    resting: Resting = field(default_factory=Resting)

    def told(self) -> dict[str, Any]:
        """Return what the page shows of it."""
        refused = [{"file": name, "reason": reason} for name, (_, reason) in sorted(self.refused.items())]
        return {
            "folder": self.folder,
            "step": self.step,
            "taken": len(self.taken),
            "waiting": self.waiting,
            "refused": refused,
            "problem": self.problem,
        }


class Watcher(BackgroundThread):
    """Takes captures out of folders.

    Parameters
    ----------
    root : Path or None
        Only folders below it may be watched; None forbids all.
    memory : Path
        The file that outlives a restart.
    load, take : callable
    max_bytes : int
        Of one measurement file.
    rest_s : float
        A file that has not changed for so long is whole.
    """

    def __init__(
        self, root: Path | None, memory: Path, load: Load, take: Take, max_bytes: int, rest_s: float = 1.0
    ) -> None:
        super().__init__("watched folders", longest_s=30.0)
        self._root = extended(root.resolve(), LONGEST_PLAIN) if root is not None else None
        self._memory = memory
        self._load, self._take_in, self._max_bytes = load, take, max_bytes
        self._rest_s = rest_s
        self._watches: dict[str, WatchedFolder] = {}
        self._lock = threading.Lock()

    def start(self) -> None:
        """Remember what was watched, and watch on; without a root nothing happens."""
        if self._root is None:
            return
        if self._memory.is_file():
            for session_id, kept in json.loads(self._memory.read_text(encoding="utf-8")).items():
                taken = {name: (size, time_ns) for name, (size, time_ns) in kept["taken"].items()}
                self._watches[session_id] = self._watched(kept["folder"], kept["step"], taken)
        super().start()

    def state(self, session_id: str) -> dict[str, Any]:
        """Return what is watched for a session, and the folders that may be."""
        watch = self._watches.get(session_id)
        return {"available": self._root is not None, "folders": self._folders(), "watch": watch and watch.told()}

    def watch(self, session_id: str, folder: str, step: StepName) -> None:
        """Watch a folder for a session, in place of the one that was.

        Raises
        ------
        ConflictError
            If this server watches none.
        InputError
            If the folder is not below the root, or is none.
        """
        # A name from outside is looked for in the list alone; what is listed may still be a link that leads away.
        if self._root is not None and folder not in self._folders():
            raise _not_there(folder)
        self._inside(folder)
        with self._lock:
            self._watches[session_id] = self._watched(folder, step, {})
            self._remember()

    def end(self, session_id: str) -> None:
        """Watch nothing more for a session."""
        with self._lock:
            self._watches.pop(session_id, None)
            self._remember()

    def look(self, now_s: float) -> None:
        """Look at all folders once, at a time of the monotonic clock."""
        for session_id, watch in list(self._watches.items()):
            try:
                self._look_at(session_id, watch, now_s)
            except NotFoundError:
                self.end(session_id)  # the session was removed
            except Exception:  # one folder's fault must not end the watching of the others
                log.exception("the folder %s, watched for session %s", watch.folder, session_id)
                watch.problem = "Looking at it failed; the server's log says more."

    def _watched(self, folder: str, step: StepName, taken: dict[str, Signature]) -> WatchedFolder:
        return WatchedFolder(folder, step, taken, resting=Resting(self._rest_s))

    def _work(self) -> None:
        while not self._stopping.wait(self._rest_s / 2):
            self.look(time.monotonic())

    def _look_at(self, session_id: str, watch: WatchedFolder, now_s: float) -> None:
        try:
            folder = self._inside(watch.folder)
            found = files_in(folder)
        except (OSError, InputError) as error:
            watch.problem = message("{folder} cannot be read: {why}", folder=watch.folder, why=error)
            return
        watch.problem = ""
        rested = watch.resting.rested(found, now_s)
        watch.waiting = []
        watch.refused = {name: entry for name, entry in watch.refused.items() if name in found}
        for name in measurements(found):
            notes = notes_of(name, found)
            signatures = [found[one] for one in (name, *notes)]
            if watch.taken.get(name) == found[name] or watch.refused.get(name, ([], ""))[0] == signatures:
                continue
            if {name, *notes} <= rested:
                self._take(session_id, watch, folder, name, notes, signatures)
            else:
                watch.waiting.append(name)

    def _take(
        self,
        session_id: str,
        watch: WatchedFolder,
        folder: Path,
        name: str,
        notes: list[str],
        signatures: list[Signature],
    ) -> None:
        session, ids = self._load(session_id)
        try:
            capture = capture_of(folder, name, notes, session, watch.step, ids)
            content = self._read(folder / name)
            if files_in(folder).get(name) != signatures[0] or len(content) != signatures[0][0]:
                watch.waiting.append(
                    name
                )  # it is being written; Windows' list tells a size of before until it is closed
                return
            self._take_in(session_id, capture, {capture.files[0]: content})
        except NotFoundError:
            raise
        except (CalibrationError, OSError) as error:
            if isinstance(error, OSError) and is_held(error):
                watch.waiting.append(name)
                return
            watch.refused[name] = (signatures, str(error))
            return
        watch.refused.pop(name, None)
        watch.taken[name] = signatures[0]
        with self._lock:
            if self._watches.get(session_id) is watch:
                self._remember()

    def _read(self, path: Path) -> bytes:
        # Not through a link that was put in the file's place since it was listed.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
        with os.fdopen(handle, "rb") as file:
            content = file.read(self._max_bytes + 1)
        if len(content) > self._max_bytes:
            to_do = "Thin the points."
            raise TooLargeError("at most {max_bytes} bytes", "more", to_do, path.name, max_bytes=self._max_bytes)
        return content

    def _inside(self, folder: str) -> Path:
        if self._root is None:
            to_do = "Start it with SCANCELL_WATCH_ROOT set to the folder below which sessions may watch."
            raise ConflictError("a server that watches folders", "one that watches none", to_do)
        path = (self._root / folder).resolve()
        if not path.is_relative_to(self._root) or not path.is_dir():
            raise _not_there(folder)
        return path

    def _folders(self) -> list[str]:
        """Return the folders that may be watched, by their paths below the root; the root itself is `.`."""
        if self._root is None or not self._root.is_dir():
            return []
        found = ["."]
        for path, folders, _ in os.walk(self._root):
            folders[:] = sorted(f for f in folders if not f.startswith("."))
            below = Path(path).relative_to(self._root)
            found += [(below / name).as_posix() for name in folders]
            if len(found) >= _MOST_FOLDERS or len(below.parts) >= 2:
                folders.clear()
        return sorted(found[:_MOST_FOLDERS])

    def _remember(self) -> None:
        kept = {i: {"folder": w.folder, "step": w.step, "taken": w.taken} for i, w in self._watches.items()}
        temporary = self._memory.with_suffix(".new")
        temporary.write_text(json.dumps(kept), encoding="utf-8")
        replace_file(temporary, self._memory)


def _not_there(folder: str) -> InputError:
    got, to_do = (
        message("nothing at {folder!r} there", folder=folder[:200]),
        message("Make it, or choose one that is listed."),
    )
    return InputError("a folder below the watched root", got, to_do, "folder")
