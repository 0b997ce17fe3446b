"""What delivers webhooks: a thread that sends what is due, to each receiver in order.

When a failed one is tried again, `server/store/webhooks.py` decides.
"""

import json
import logging
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Final

from calib_core import __version__
from server.background import BackgroundThread
from server.settings import Settings
from server.store.database import Store
from server.store.secrets import load_key
from server.store.webhooks import Delivery, due_deliveries, note_attempt
from server.webhooks.signing import secret_of, signed_headers

if TYPE_CHECKING:
    import httpx

log = logging.getLogger("scancell")

_TIMEOUT_S: Final = 10.0
_CONNECT_TIMEOUT_S: Final = 5.0
_LOOK_S: Final = 5.0
_PAUSE_S: Final = 0.2  # events come by the hundred a second
_AT_ONCE: Final = 8  # webhooks whose receivers are spoken to at the same time
_HEADERS: Final = {"Content-Type": "application/json", "User-Agent": f"scancell/{__version__}"}


class WebhookSender(BackgroundThread):
    """Sends what a transaction left to be delivered; what a killed server left, the next one sends."""

    def __init__(self, settings: Settings, store: Store) -> None:
        super().__init__("webhooks")
        self._settings, self._store = settings, store

    def _work(self) -> None:
        with ExitStack() as opened, ThreadPoolExecutor(_AT_ONCE, "webhook") as threads:
            client: httpx.Client | None = None  # made for the first delivery: its certificates take time
            while not self._stopping.is_set():
                self._woken.clear()
                try:
                    with self._store.read() as db:
                        due = due_deliveries(db)
                    if due:
                        client = client or opened.enter_context(_new_client(self._settings))
                        by_webhook = [list(group) for _, group in groupby(due, key=lambda one: one.webhook_id)]
                        list(threads.map(partial(self._deliver, client), by_webhook))
                except Exception:  # a locked database, a full disk: it stays due
                    log.exception("webhooks could not be served")
                    due = []
                if not due and not self._stopping.wait(_PAUSE_S):
                    self._woken.wait(_LOOK_S)

    def _deliver(self, client: "httpx.Client", deliveries: Sequence[Delivery]) -> None:
        """Send a webhook's deliveries until one fails: the others wait with it and stay in their order."""
        for delivery in deliveries:
            if self._stopping.is_set():
                return
            answered, error = self._send(client, delivery)
            with self._store.write() as db:
                if not note_attempt(db, delivery, answered, error):
                    return

    def _send(self, client: "httpx.Client", delivery: Delivery) -> tuple[int | None, str | None]:
        """Return the status that the receiver answered with, or in words why there was none."""
        import httpx

        body = json.dumps(delivery.payload, ensure_ascii=False).encode()
        secret = secret_of(load_key(self._settings.data), delivery.webhook_id)
        try:
            headers = signed_headers(secret, delivery.payload["id"], int(time.time()), body)
            with client.stream("POST", delivery.url, content=body, headers=headers) as answer:
                return answer.status_code, None  # what it says beside its status is of no use here
        except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError) as error:
            return None, str(error)[:300] or type(error).__name__


def _new_client(settings: Settings) -> "httpx.Client":
    import httpx  # late: with it comes what only its command line needs

    from server.webhooks.addresses import CheckedTransport

    transport = CheckedTransport(settings, httpx.HTTPTransport(trust_env=False))
    return httpx.Client(
        timeout=httpx.Timeout(_TIMEOUT_S, connect=_CONNECT_TIMEOUT_S),
        follow_redirects=False,
        headers=_HEADERS,
        trust_env=False,
        transport=transport,
    )
