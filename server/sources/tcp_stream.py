"""What sources on TCP have in common: a connection over which messages come in pieces."""

import socket
import time
from collections.abc import Callable

from calib_core.errors import CalibrationError
from calib_core.messages import message

_CONNECT_S = 2.0
_PIECE_BYTES = 8192


class TcpStream:
    """A connection to a controller, with what it has sent and nobody has taken yet.

    Parameters
    ----------
    host, port : str, int
    wait_s : float
        How long is waited for the next piece.
    """

    def __init__(self, host: str, port: int, wait_s: float) -> None:
        self._socket = socket.create_connection((host, port), timeout=_CONNECT_S)
        self._socket.settimeout(wait_s)
        self._wait_s, self._rest = wait_s, b""

    def send(self, content: bytes) -> None:
        """Send bytes; raises OSError."""
        self._socket.sendall(content)

    def exactly(self, count: int) -> bytes:
        """Return so many bytes; raises OSError, also where none come in time."""
        while len(self._rest) < count:
            self._receive()
        found, self._rest = self._rest[:count], self._rest[count:]
        return found

    def first(self, split: Callable[[bytes], tuple[str, bytes] | None]) -> str | None:
        """Return the first message, None where none is whole in time; raises OSError.

        Parameters
        ----------
        split : callable
            Returns the first message of what has come and the rest, None where it is not whole yet.  Where it
            raises CalibrationError, what has come is left out.
        """
        until_s = time.monotonic() + self._wait_s
        try:
            while (found := split(self._rest)) is None:
                if time.monotonic() > until_s:
                    return None
                self._receive()
        except TimeoutError:
            return None
        except CalibrationError:
            self._rest = b""
            raise
        message, self._rest = found
        return message

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _receive(self) -> None:
        more = self._socket.recv(_PIECE_BYTES)
        if not more:
            raise ConnectionError(message("the controller closed the connection"))
        self._rest += more
