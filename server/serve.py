"""Serving over HTTP and WebSockets with uvicorn."""

import gc
import math
import sys
from functools import partial
from signal import SIGINT
from socket import socket
from types import FrameType

import uvicorn

from server.app import create_app
from server.auth.logins import require_admin
from server.auth.slow_heads import SlowHeads
from server.heap import give_back
from server.http.address_limit import AddressLimit
from server.http.events import Hub
from server.http.protocol import LimitedHttp
from server.settings import Settings, address_of, is_loopback
from server.store.store_lock import store_lock

_MAX_MESSAGE_BYTES = 64 * 1024 * 1024  # a scene's point clouds travel in one WebSocket message
_KEEP_ALIVE_S = 30  # longer than clients keep idle connections: else a request meets the hanging up


_SWITCH_S = 0.001  # what answers has little to do and waits for what works, five times as long by default
_NEW_OBJECTS = 20_000  # between two looks for garbage in circles; 700 by default, a fraction of one request's
_TICKS_BETWEEN = 300  # from one look through all objects to the next: half a minute


class WorkbenchServer(uvicorn.Server):
    """The server of the workbench; `run()` serves until a signal or `stop()`.

    Its event streams end when it is told to stop; else they would hold it for as long as a page is open.
    """

    def __init__(self, settings: Settings) -> None:
        app = create_app(settings)
        self._app = app
        self._hub: Hub = app.state.hub
        self._settings = settings
        self._slow_heads = SlowHeads(settings.head_timeout_s)
        self._looked = 0
        of_address = AddressLimit(settings.max_connections_per_address, settings.trusted_proxies)
        config = uvicorn.Config(
            app,
            host=settings.host,
            port=settings.port,
            http=partial(LimitedHttp, of_address=of_address),  # type: ignore[arg-type]
            log_level="warning",
            server_header=False,
            ws_max_size=_MAX_MESSAGE_BYTES,
            ws_per_message_deflate=False,
            timeout_keep_alive=_KEEP_ALIVE_S,
            timeout_graceful_shutdown=math.ceil(settings.shutdown_grace_s),
            log_config=None,
            limit_concurrency=settings.max_connections,
            proxy_headers=bool(settings.trusted_proxies),
            forwarded_allow_ips=settings.trusted_proxies,
            ssl_certfile=settings.tls_certificate,
            ssl_keyfile=settings.tls_key,
        )
        super().__init__(config)

    def run(self, sockets: list[socket] | None = None) -> None:
        """Serve; raises InputError or ConflictError if the store cannot be used, or nobody could log in."""
        sys.setswitchinterval(_SWITCH_S)
        gc.freeze()  # modules and routes stay: nobody's request waits while they are looked through
        gc.set_threshold(_NEW_OBJECTS)
        gc.enable()
        with store_lock(self._settings) as lock:
            self._app.state.database_lock = lock
            if self._settings.login_required:
                require_admin(self._settings)
            super().run(sockets)

    async def on_tick(self, counter: int) -> bool:
        """Look about ten times a second after what must be done by the clock; returns whether to stop."""
        if counter % 10 == 0:
            self._slow_heads.close_old(self.server_state.connections)
        if counter % _TICKS_BETWEEN == 0:
            self._collect()
        return await super().on_tick(counter)

    def _collect(self) -> None:
        """Let go of what is in circles and has become old, such as closed scenes, unless nothing happened since.

        By itself Python would wait for millions of new objects, and scenes hold megabytes in few of them.
        """
        looked = gc.get_stats()[0]["collections"]
        if looked != self._looked:
            gc.collect()
            give_back()
            if not self._looked:  # what the start has made stays, too
                gc.freeze()
            self._looked = gc.get_stats()[0]["collections"]

    async def shutdown(self, sockets: list[socket] | None = None) -> None:
        """End what is under way, and let go of all resources, also where it was told to wait for nothing."""
        await super().shutdown(sockets)
        if self.force_exit:
            await self.lifespan.shutdown()

    def stop(self) -> None:
        """End the streams, then everything else; may be called from any thread."""
        self._hub.close()
        self.should_exit = True

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Stop because of a signal; at the second Ctrl-C without waiting for what is under way.

        The signal is not raised again afterwards, as uvicorn would: `run` returns, and all resources are let go.
        """
        self.force_exit = self.should_exit and sig == SIGINT
        self.stop()

    @property
    def is_in_the_clear(self) -> bool:
        """Whether what others send here can be read on its way."""
        return not self.config.is_ssl and not is_loopback(self._settings.host)

    @property
    def address(self) -> str:
        """Where it is served, once it has started."""
        host, port = self.servers[0].sockets[0].getsockname()[:2]
        return address_of("https" if self.config.is_ssl else "http", host, port)
