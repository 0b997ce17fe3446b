"""A camera or scanner over HTTP: exposures one after the other, as multipart/x-mixed-replace."""

import socket
import time
from collections.abc import Callable

from server.simulated_cell.tcp_server import TcpServer

_BOUNDARY = "exposure"


class StreamServer(TcpServer):
    """Sends what `expose` returns, so many times a second, with its device time in `X-Timestamp`."""

    def __init__(
        self,
        expose: Callable[[], tuple[bytes, str, float]],
        rate_hz: float = 20.0,
        host: str = "127.0.0.1",
        port: int = 0,
    ) -> None:
        self._expose, self._period_s = expose, 1.0 / rate_hz
        self.sent = 0
        super().__init__(host, port)

    @property
    def url(self) -> str:
        """Where it is read."""
        return f"http://127.0.0.1:{self.port}/"

    def serve(self, peer: socket.socket) -> None:
        """Read the request's head, then send exposures."""
        head = b""
        while b"\r\n\r\n" not in head and len(head) < 8192:
            more = peer.recv(2048)
            if not more:
                return
            head += more
        kind = f"multipart/x-mixed-replace; boundary={_BOUNDARY}"
        peer.sendall(f"HTTP/1.0 200 OK\r\nContent-Type: {kind}\r\nCache-Control: no-store\r\n\r\n".encode())
        next_s = time.monotonic()
        while not self.stopped.is_set():
            content, media_type, moment_s = self._expose()
            about = f"--{_BOUNDARY}\r\nContent-Type: {media_type}\r\nContent-Length: {len(content)}\r\n"
            peer.sendall(f"{about}X-Timestamp: {moment_s:.6f}\r\n\r\n".encode() + content + b"\r\n")
            self.sent += 1
            next_s += self._period_s
            time.sleep(max(0.0, next_s - time.monotonic()))
