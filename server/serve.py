"""Serving over HTTP and WebSockets with uvicorn."""

from signal import SIGINT
from socket import socket
from types import FrameType

import uvicorn

from server.app import create_app
from server.events import Hub
from server.settings import Settings
from server.store.folder import owned

_MAX_MESSAGE_BYTES = 64 * 1024 * 1024  # a scene's point clouds travel in one WebSocket message


class WorkbenchServer(uvicorn.Server):
    """The server of the workbench; `run()` serves until a signal or `stop()`.

    Its event streams end when it is told to stop; else they would hold it for as long as a page is open.
    """

    def __init__(self, settings: Settings) -> None:
        app = create_app(settings)
        self._hub: Hub = app.state.hub
        self._data = settings.data
        config = uvicorn.Config(
            app,
            host=settings.host,
            port=settings.port,
            log_level="warning",
            server_header=False,
            ws_max_size=_MAX_MESSAGE_BYTES,
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=5,
        )
        super().__init__(config)

    def run(self, sockets: list[socket] | None = None) -> None:
        """Serve; raises InputError or ConflictError if the data folder cannot be used."""
        with owned(self._data):
            super().run(sockets)

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
    def address(self) -> str:
        """Where it is served, once it has started."""
        host, port = self.servers[0].sockets[0].getsockname()[:2]
        return f"http://{f'[{host}]' if ':' in host else host}:{port}"
