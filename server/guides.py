"""The guides that pages ask for: worked out elsewhere, one at a time, always for the newest state of a session."""

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from server.jobs.page_process import PageProcess, PageProcessError
from server.page_questions import guide_text
from server.store.database import Store
from server.store.process_data import SessionTexts
from server.store.session_texts import load_texts


class Guides:
    """Gives guides as JSON text.

    A session's record is read when its turn comes.  Whoever asks until then gets the same guide; whoever asks
    later, while it is worked out, gets the next one, for something may have changed.

    Parameters
    ----------
    load : callable
        Returns all that a session's guide is made of; raises NotFoundError.
    process : PageProcess
    """

    def __init__(self, load: Callable[[str], SessionTexts], process: PageProcess) -> None:
        self._load, self._process = load, process
        self._lock = threading.Lock()
        self._waiting: dict[str, Future[str]] = {}
        self._thread = ThreadPoolExecutor(1, "guides")

    def ask(self, session_id: str) -> "Future[str]":
        """Return what will be the guide of a session, from what is stored now or later."""
        with self._lock:
            waiting = self._waiting.get(session_id)
            if waiting is None:
                waiting = Future[str]()
                waiting.set_running_or_notify_cancel()  # one who hangs up cancels nobody else's
                try:
                    self._thread.submit(self._answer, session_id)
                except RuntimeError:
                    raise PageProcessError("the server stops") from None
                self._waiting[session_id] = waiting
            return waiting

    def stop(self) -> None:
        """Answer nobody any more."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for one in waiting.values():
            one.set_exception(PageProcessError("the server stops"))

    def _answer(self, session_id: str) -> None:
        with self._lock:
            waiting = self._waiting.pop(session_id, None)
        if waiting is None:
            return
        try:
            waiting.set_result(self._process.ask(guide_text, self._load(session_id)))
        except BaseException as error:
            waiting.set_exception(error)


def stored_texts(store: Store) -> Callable[[str], SessionTexts]:
    """Return what loads a session of the store."""

    def load(session_id: str) -> SessionTexts:
        with store.read() as db:
            return load_texts(db, session_id)

    return load
