"""A line between browser and server that stops carrying what the browser sends, as a bad network does."""

import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial

_UPLOAD = re.compile(rb"POST \S+/captures[ /?]")


class BrokenLine:
    """Carries bytes both ways; while `most_up` is set, of a capture at most so many go up, and then nothing ever.

    Each connection carries one request: on one that is used again, Chromium repeats what was answered with 408 by
    itself, and the page hears of it only after many tries.
    """

    def __init__(self, port: int) -> None:
        self.most_up: int | None = None
        self._port = port
        self._door = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._begin(self._open)

    @property
    def site(self) -> str:
        return f"http://127.0.0.1:{self._door.getsockname()[1]}"

    def close(self) -> None:
        for end in (self._door, *self._ends):
            with suppress(OSError):  # the other side may have gone
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for end in (self._door, *self._ends):
            end.close()

    def _begin(self, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _open(self) -> None:
        with suppress(OSError):  # the door was closed
            while True:
                below, _ = self._door.accept()
                above = socket.create_connection(("127.0.0.1", self._port))
                self._ends += [below, above]
                self._begin(partial(self._up, below, above))
                self._begin(partial(_carry, above, below))

    def _up(self, below: socket.socket, above: socket.socket) -> None:
        left: int | None = None
        with suppress(OSError):
            while content := below.recv(65536):
                content = content.replace(b"\r\nConnection: keep-alive\r\n", b"\r\nConnection: close\r\n")
                if left is None and self.most_up is not None and _UPLOAD.match(content):
                    left = self.most_up
                above.sendall(content if left is None else content[:left])
                left = left if left is None else max(0, left - len(content))
            above.shutdown(socket.SHUT_WR)


def _carry(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while content := source.recv(65536):
            target.sendall(content)
        target.shutdown(socket.SHUT_WR)


@contextmanager
def broken_line(port: int) -> Iterator[BrokenLine]:
    line = BrokenLine(port)
    yield line
    line.close()
