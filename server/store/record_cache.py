"""Records that were read from their texts, kept while they are asked for again and again."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

Read = TypeVar("Read")


class KeptRecords(Generic[Read]):
    """What texts were read into; bounded by the texts' length, and what nobody asks for any more is let go of.

    Parameters
    ----------
    read : callable
        Makes the record of a text.
    most_characters : int
        Of all the texts together; the ones that were asked for longest ago go first.
    rest_s : float
        A record that nobody asked for in this time goes when another one is read.
    """

    def __init__(self, read: Callable[[str], Read], most_characters: int, rest_s: float) -> None:
        self._read = read
        self._most_characters, self._rest_s = most_characters, rest_s
        self._kept: OrderedDict[str, tuple[float, Read]] = OrderedDict()  # what was asked for last is last
        self._characters = 0
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._kept)

    def of(self, text: str) -> Read:
        """Return the record of a text; it may be the one that others have, so nobody may change it."""
        now_s = time.monotonic()
        with self._lock:
            known = self._kept.pop(text, None)
            if known is not None:
                self._kept[text] = (now_s, known[1])
                return known[1]
        record = self._read(text)
        with self._lock:
            if text not in self._kept:
                self._characters += len(text)
            self._kept[text] = (now_s, record)
            self._let_go(now_s)
        return record

    def _let_go(self, now_s: float) -> None:
        while self._kept:
            text, (asked_s, _) = next(iter(self._kept.items()))
            if self._characters <= self._most_characters and now_s - asked_s <= self._rest_s:
                return
            del self._kept[text]
            self._characters -= len(text)
