"""Refused requests: their senders are slowed down and noted in the log of who did what."""

import logging
from math import ceil

from calib_core.messages import message
from server.auth.buckets import Buckets
from server.http.errors import TooManyError
from server.store.audit import Act, note_refusal
from server.store.database import Store

log = logging.getLogger("scancell")

_TRIALS, _TRIALS_PER_S = 10, 0.2
# A flood of refusals must not fill the disk: beyond this it only shows in the server's own log.
_NOTED, _NOTED_PER_S = 20, 0.1


class Refusals:
    """Refused requests of all addresses."""

    def __init__(self) -> None:
        self._trials = Buckets(_TRIALS_PER_S, _TRIALS)
        self._noted = Buckets(_NOTED_PER_S, _NOTED)

    def wrong_secret(self, address: str) -> None:
        """Count a token or a login that was none; raises TooManyError after ten in a row."""
        wait_s = self._trials.wait_s(address)
        if wait_s:
            raise too_many(wait_s, message("a good token"), message("many in a row that are not"))

    def note(self, store: Store, act: Act) -> None:
        """Add a refused request to the log of who did what."""
        log.warning("refused %s %s from %s (%s)", act.method, ascii(act.path), act.address, act.who)
        if self._noted.wait_s(act.address) == 0:
            with store.write() as db:
                note_refusal(db, act)


def too_many(wait_s: float, need: str, got: str) -> TooManyError:
    """Return the error of somebody who asks too often."""
    seconds = max(1, ceil(wait_s))
    error = TooManyError(need, got, "Send the next request in {seconds} s.", "request", seconds=seconds)
    error.retry_after_s = seconds
    return error
