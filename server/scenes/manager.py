"""The live scenes of all sessions: opened at the first view, kept up to date, closed when nobody looks."""

import contextlib
import logging
import threading
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

from calib_core.errors import CalibrationError, NotFoundError
from server.scenes.advice import no_advice
from server.scenes.cloud_view import CloudView
from server.scenes.live import LiveScene
from server.scenes.scene_input import SceneInput

LoadScene = Callable[[str], SceneInput | None]

_log = logging.getLogger(__name__)


Subscribe = Callable[[str, Callable[[], None]], Callable[[], None]]
"""Has a callable called at each event of a session; returns what ends that."""


@dataclass
class _Entry:
    """A scene, or one that is being opened; `opening` is held while that lasts."""

    opening: threading.Lock = field(default_factory=threading.Lock)
    scene: LiveScene | None = None
    unsubscribe: Callable[[], None] | None = None
    viewers: int = 0
    timer: threading.Timer | None = None
    waiting: bool = False

    def stop(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
        if self.unsubscribe is not None:
            self.unsubscribe()
        if self.scene is not None:
            self.scene.stop()


class SceneManager:
    """Opens, refreshes and closes scenes.

    Parameters
    ----------
    load : callable
        Gives a session's scene input by the session's id, None where there is no such session.  It is called on
        threads of its own.
    subscribe : callable, optional
        Tells of a session's events while its scene is open; without it call `refresh`.
    idle_s : float
        How long a scene stays after its last viewer has left.

    Notes
    -----
    Whatever happens to the server, a scene is rebuilt from the session when it is looked at next; viser's client
    reconnects by itself.
    """

    def __init__(self, load: LoadScene, subscribe: Subscribe | None = None, idle_s: float = 120.0) -> None:
        self._load = load
        self._subscribe = subscribe
        self._idle_s = idle_s
        self._entries: dict[str, _Entry] = {}
        self._lock = threading.Lock()  # held for moments only: it is taken on the event loop too
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="scenes")

    def __contains__(self, session_id: str) -> bool:
        return session_id in self._entries

    @contextlib.contextmanager
    def viewing(self, session_id: str) -> Generator[LiveScene]:
        """Give the live scene of a session while somebody looks at it.

        Raises
        ------
        NotFoundError
            If there is no such session.
        """
        entry = self._enter(session_id)
        try:
            yield self._opened(session_id, entry)
        finally:
            self._leave(session_id, entry)

    def require(self, session_id: str) -> None:
        """Refuse a session that does not exist; raises NotFoundError."""
        if session_id not in self._entries:
            self.load(session_id)

    def picture(self, session_id: str) -> str:
        """Return a session's small picture as SVG, whether its scene is open or not.

        Raises
        ------
        NotFoundError
            If there is no such session.
        """
        from server.scenes.picture import session_picture

        return session_picture(self.load(session_id))

    def load(self, session_id: str) -> SceneInput:
        """Return what a scene is drawn from, whether it is open or not; raises NotFoundError."""
        scene = self._load(session_id)
        if scene is None:
            to_do = "Take one of those that are listed."
            raise NotFoundError("a session", "the id '{session_id}', which none has", to_do, session_id=session_id)
        return scene

    def live(self, session_id: str) -> LiveScene | None:
        """Return a scene that is open, None where nobody looks."""
        entry = self._entries.get(session_id)
        return entry.scene if entry else None

    def legend(self, session_id: str) -> str:
        """Return the legend of a live scene, empty where nobody looks at it."""
        live = self.live(session_id)
        return live.legend if live else ""

    def refresh(self, session_id: str) -> None:
        """Bring a scene up to date soon; calls in quick succession become one, and without a scene nothing."""
        entry = self._entries.get(session_id)
        if entry is not None and not entry.waiting:
            entry.waiting = True
            self._soon(self._refresh, session_id, entry)

    def highlight(self, session_id: str, capture_id: str | None) -> None:
        """Light up one capture of a scene soon, or none."""
        live = self.live(session_id)
        if live is not None:
            self._soon(live.highlight, capture_id)

    def show_cloud(self, session_id: str, how: CloudView) -> None:
        """Show a scene's merged cloud in another way soon."""
        live = self.live(session_id)
        if live is not None:
            self._soon(live.show_cloud, how)

    def close(self, session_id: str) -> None:
        """Close a scene now, as when its session is deleted."""
        with self._lock:
            entry = self._entries.pop(session_id, None)
        if entry is not None:
            entry.stop()

    def stop(self) -> None:
        """Close all scenes and end the worker."""
        self._worker.shutdown(wait=True, cancel_futures=True)
        for session_id in list(self._entries):
            self.close(session_id)

    def _soon(self, act: Callable[..., object], *arguments: object) -> None:
        with contextlib.suppress(RuntimeError):  # the worker has ended: so will the scenes
            self._worker.submit(act, *arguments)

    def _enter(self, session_id: str) -> _Entry:
        with self._lock:
            entry = self._entries.setdefault(session_id, _Entry())
            if entry.timer is not None:
                entry.timer.cancel()
                entry.timer = None
            entry.viewers += 1
            return entry

    def _opened(self, session_id: str, entry: _Entry) -> LiveScene:
        with entry.opening:
            if entry.scene is None:
                entry.scene = LiveScene(replace(self.load(session_id), advise=no_advice))  # that takes its time
                if self._subscribe is not None:
                    entry.unsubscribe = self._subscribe(session_id, lambda: self.refresh(session_id))
                self.refresh(session_id)  # for the advice, and what happened since it was loaded
            return entry.scene

    def _leave(self, session_id: str, entry: _Entry) -> None:
        with self._lock:
            entry.viewers -= 1
            if entry.viewers or self._entries.get(session_id) is not entry:
                return
            if entry.scene is None:
                del self._entries[session_id]
                return
            entry.timer = threading.Timer(self._idle_s, self._close_if_idle, (session_id, entry))
            entry.timer.daemon = True
            entry.timer.start()

    def _close_if_idle(self, session_id: str, entry: _Entry) -> None:
        with self._lock:
            if entry.viewers or self._entries.get(session_id) is not entry:
                return
            del self._entries[session_id]
        entry.stop()

    def _refresh(self, session_id: str, entry: _Entry) -> None:
        entry.waiting = False  # from here on a call means a newer state than the one loaded below
        try:
            scene = self._load(session_id)
            if scene is None:
                self.close(session_id)
            elif entry.scene is not None:
                entry.scene.update(scene)
        except CalibrationError as error:
            _log.warning("the scene of session %s was not redrawn: %s", session_id, error)
        except Exception:
            _log.exception("the scene of session %s was not redrawn", session_id)
