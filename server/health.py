"""Whether what the server rests on is there: looked at now and then, so that whoever asks is answered at once."""

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Final

log = logging.getLogger("scancell")

_LOOK_S: Final = 2.0
_LOOK_AGAIN_S: Final = 0.5  # while something is away: whoever waits for it goes on soon
_LATE_S: Final = 12.0
_STORE: Final = ("database", "files", "lock")
"""Without these nothing can be stored; without others the server goes on taking captures."""

Check = Callable[[], str | None]


class HealthWatch:
    """A thread for each thing that may be away, which says in words what is wrong with it.

    Parameters
    ----------
    checks : mapping of str to callable
        Each returns its trouble in words, None where there is none; raising is trouble too.
    """

    def __init__(self, checks: Mapping[str, Check]) -> None:
        self._checks = dict(checks)
        self._found: dict[str, tuple[float, str | None]] = {}
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._watch, args=(name,), name=f"health of {name}", daemon=True)
            for name in self._checks
        ]

    def start(self) -> None:
        """Begin to look."""
        begun_s = time.monotonic()
        self._found = dict.fromkeys(self._checks, (begun_s, None))
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End; what hangs is left alone."""
        self._stopping.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(_LOOK_S)

    def troubles(self) -> dict[str, str]:
        """Return what is wrong, by what it is wrong with."""
        return dict(self._troubles())

    @property
    def can_store(self) -> bool:
        """Whether captures can be stored."""
        return not self.troubles().keys() & set(_STORE)

    def _troubles(self) -> Iterator[tuple[str, str]]:
        for name, (looked_s, trouble) in list(self._found.items()):
            if time.monotonic() - looked_s > _LATE_S:
                yield name, "does not answer"
            elif trouble is not None:
                yield name, trouble

    def _watch(self, name: str) -> None:
        while not self._stopping.is_set():
            trouble = _in_words(self._checks[name])
            if trouble != self._found[name][1]:
                log.warning("%s: %s", name, trouble or "well again")
            self._found[name] = time.monotonic(), trouble
            self._stopping.wait(_LOOK_S if trouble is None else _LOOK_AGAIN_S)


def _in_words(check: Check) -> str | None:
    try:
        return check()
    except Exception as error:
        said = " ".join(str(getattr(error, "orig", None) or error).split())
        return said[:300] or type(error).__name__
