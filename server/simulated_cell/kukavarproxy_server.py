"""KUKAVARPROXY: variables of a controller, read alone."""

import socket
import struct
from collections.abc import Callable

from server.simulated_cell.tcp_server import TcpServer, exactly


class KukaVarProxyServer(TcpServer):
    """Answers with what `variable` returns for a name; unknown ones are empty."""

    def __init__(self, variable: Callable[[str], str], host: str = "127.0.0.1", port: int = 0) -> None:
        self._variable = variable
        super().__init__(host, port)

    def serve(self, peer: socket.socket) -> None:
        """Answer question by question."""
        while not self.stopped.is_set():
            number, size = struct.unpack(">HH", exactly(peer, 4))
            body = exactly(peer, size)
            (length,) = struct.unpack(">H", body[1:3])
            value = self._variable(body[3 : 3 + length].decode("latin-1")).encode("latin-1")
            answer = (
                struct.pack(">BH", body[0], len(value)) + value + (b"\x00\x01\x01" if value else b"\x00\x00\x00")
            )
            peer.sendall(struct.pack(">HH", number, len(answer)) + answer)
