"""What the simulated devices on TCP have in common: a thread that accepts, and one for each connection."""

import socket
import threading
from abc import ABC, abstractmethod
from contextlib import suppress


class TcpServer(ABC):
    """A device on a port of this machine.

    `cut` ends its connections as a pulled cable or a restart does; while `is_out` is set, new ones are refused.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        self._listening = socket.create_server((host, port))
        self._listening.settimeout(0.1)
        self.port: int = self._listening.getsockname()[1]
        self.is_out = threading.Event()
        self.stopped = threading.Event()
        self._peers: set[socket.socket] = set()
        self._threads: list[threading.Thread] = []
        self._accepting = threading.Thread(target=self._accept, name=type(self).__name__, daemon=True)
        self._accepting.start()

    @abstractmethod
    def serve(self, peer: socket.socket) -> None:
        """Speak with who has connected, until OSError or `stopped`."""

    def cut(self) -> None:
        """End all connections."""
        for peer in list(self._peers):
            with suppress(OSError):
                peer.shutdown(socket.SHUT_RDWR)

    def stop(self) -> None:
        """End everything."""
        self.stopped.set()
        self.cut()
        self._accepting.join()
        for thread in self._threads:
            thread.join(timeout=5)
        self._listening.close()

    def _accept(self) -> None:
        while not self.stopped.is_set():
            try:
                peer, _ = self._listening.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            if self.is_out.is_set():
                peer.close()
                continue
            peer.settimeout(None)
            thread = threading.Thread(target=self._with, args=(peer,), daemon=True)
            self._threads = [*(t for t in self._threads if t.is_alive()), thread]
            thread.start()

    def _with(self, peer: socket.socket) -> None:
        self._peers.add(peer)
        try:
            with suppress(OSError):
                self.serve(peer)
        finally:
            self._peers.discard(peer)
            peer.close()


def exactly(peer: socket.socket, count: int) -> bytes:
    """Return so many bytes from a connection; raises OSError at its end."""
    found = b""
    while len(found) < count:
        more = peer.recv(count - len(found))
        if not more:
            raise ConnectionError("the other side has gone")
        found += more
    return found
