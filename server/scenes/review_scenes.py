"""Scenes of the past: a page that reviews a session has a scene of its own, and moves it through the time line."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from calib_core.errors import NotFoundError
from server.scenes.advice import advice_for
from server.scenes.scene_input import SceneAdvice, SceneInput
from server.scenes.stored import scene_of, stored_scene
from server.store.history import compared, moment
from server.store.sessions import load_session

if TYPE_CHECKING:
    from server.store.database import Store

_MOST: Final = 1000  # places that are remembered, of pages that may come back


class PastScenes:
    """Gives scenes by their keys: a session's id, or `id.name` for a page's own scene of the session's past.

    Parameters
    ----------
    store : Store
    advise : callable, optional
        Gives what takes long to work out.
    """

    def __init__(self, store: "Store", advise: "Callable[[SceneInput], SceneAdvice]" = advice_for) -> None:
        self._store, self._advise = store, advise
        self._places: OrderedDict[str, int] = OrderedDict()
        self._compared: OrderedDict[str, tuple[str, str, str]] = OrderedDict()
        self._lock = threading.Lock()

    def load(self, key: str) -> SceneInput | None:
        """Return a scene as it is now, or at its place on the time line; None where there is no such session."""
        found = self._loaded(key)
        return None if found is None else replace(found, advise=self._advise)

    def _loaded(self, key: str) -> SceneInput | None:
        session_id = session_of(key)
        if (both := self._compared.get(key)) is not None:
            return self._both(session_id, *both)
        place = self._places.get(key)
        if key == session_id or place is None:
            return stored_scene(self._store, session_id)
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
        _require_own(key)
        with self._lock:
            _keep(self._places, key, place)

    def compare(self, key: str, stage: str, left: str, right: str) -> None:
        """Let a page's own scene show two results of a stage from its next refresh on.

        Parameters
        ----------
        key, stage : str
        left, right : str
            SESSION or SESSION:NUMBER, the first of the session that the key names.

        Raises
        ------
        NotFoundError
            If the key is that of the session's own scene, or there is no such result.
        """
        _require_own(key)
        with self._store.read() as db:
            for side in (left, right):
                compared(db, self._store.blobs, stage, side)
        with self._lock:
            _keep(self._compared, key, (stage, left, right))

    def _both(self, session_id: str, stage: str, left: str, right: str) -> SceneInput | None:
        """Return the first session's scene with both answers in it; as it is now where one of them is gone."""
        from calib_core.review.placed_points import placed_points

        try:
            with self._store.read() as db:
                first, second = (compared(db, self._store.blobs, stage, side) for side in (left, right))
                stored = load_session(db, self._store.blobs, session_id)
        except NotFoundError:
            return stored_scene(self._store, session_id)
        with_first = replace(stored, results={**stored.results, stage: dict(first.record)})
        return replace(scene_of(with_first), compared=tuple(placed_points(first, second)))


def _require_own(key: str) -> None:
    if key == session_of(key):
        raise NotFoundError("a scene of a page's own", f"'{key}'", "Name it SESSION.NAME.", "session")


def _keep(known: OrderedDict[str, Any], key: str, what: object) -> None:
    known[key] = what
    known.move_to_end(key)
    while len(known) > _MOST:
        known.popitem(last=False)


def session_of(key: str) -> str:
    """Return the id of the session that a scene shows."""
    return key.partition(".")[0]
