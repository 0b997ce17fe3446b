"""Scenes of the past: a page that reviews a session has a scene of its own, and moves it through the time line."""

import threading
from collections import OrderedDict
from typing import TYPE_CHECKING, Final

from calib_core.errors import NotFoundError
from server.scenes.facts import SceneInput
from server.scenes.stored import scene_of, stored_scene

if TYPE_CHECKING:
    from server.store.database import Store

_MOST: Final = 1000  # places that are remembered, of pages that may come back


class PastScenes:
    """Gives scenes by their keys: a session's id, or `id.name` for a page's own scene of the session's past.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: "Store") -> None:
        self._store = store
        self._places: OrderedDict[str, int] = OrderedDict()
        self._lock = threading.Lock()

    def load(self, key: str) -> SceneInput | None:
        """Return a scene as it is now, or at its place on the time line; None where there is no such session."""
        session_id = session_of(key)
        place = self._places.get(key)
        if key == session_id or place is None:
            return stored_scene(self._store, session_id)
        from server.store.history import moment

        try:
            with self._store.read() as db:
                return scene_of(moment(db, self._store.blobs, session_id, place).stored)
        except NotFoundError:
            return stored_scene(self._store, session_id)

    def go(self, key: str, place: int) -> None:
        """Let a scene of the past stand at a place of the time line from its next refresh on.

        Raises
        ------
        NotFoundError
            If the key is that of the session's own scene, which always shows the present.
        """
        if key == session_of(key):
            raise NotFoundError("a scene of the past", f"'{key}'", "Name it SESSION.NAME.", "session")
        with self._lock:
            self._places[key] = place
            self._places.move_to_end(key)
            while len(self._places) > _MOST:
                self._places.popitem(last=False)


def session_of(key: str) -> str:
    """Return the id of the session that a scene shows."""
    return key.partition(".")[0]
