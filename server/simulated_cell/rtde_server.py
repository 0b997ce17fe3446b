"""A controller's RTDE: version, outputs, start, data; 500 Hz at most."""

import select
import socket
import struct
import time
from collections.abc import Callable, Mapping

from server.simulated_cell.tcp_server import TcpServer, exactly

_TYPES = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "actual_TCP_speed": "VECTOR6D",
    "tcp_offset": "VECTOR6D",
}
_VERSION, _CONTROLLER_VERSION, _SETUP, _START, _PAUSE, _DATA = b"VvOSPU"

_BUFFERED_S = 2.0
"""Messages of so long are sent late rather than left out."""

Outputs = Callable[[float], Mapping[str, tuple[float, ...]]]
"""Returns the outputs' values by name at a moment of `time.monotonic`."""


class RtdeServer(TcpServer):
    """Sends what `outputs` returns, as the client has asked for it."""

    def __init__(self, outputs: Outputs, host: str = "127.0.0.1", port: int = 0) -> None:
        self._outputs = outputs
        super().__init__(host, port)

    def serve(self, peer: socket.socket) -> None:
        """Agree on outputs, then send them until the client pauses or leaves."""
        names: list[str] = []
        period_s = 0.008
        while not self.stopped.is_set():
            size, kind = struct.unpack(">HB", exactly(peer, 3))
            body = exactly(peer, size - 3)
            if kind == _VERSION:
                _send(peer, kind, b"\x01")
            elif kind == _CONTROLLER_VERSION:
                _send(peer, kind, struct.pack(">IIII", 5, 11, 1, 0))
            elif kind == _SETUP:
                (frequency_hz,) = struct.unpack(">d", body[:8])
                period_s = 1.0 / min(max(frequency_hz, 1.0), 500.0)
                names = [name for name in body[8:].decode("ascii").split(",") if name]
                told = self._outputs(time.monotonic())
                types = ",".join(_TYPES[name] if name in told else "NOT_FOUND" for name in names)
                _send(peer, kind, b"\x01" + types.encode())
            elif kind == _START:
                _send(peer, kind, b"\x01")
                self._stream(peer, names, period_s)
            else:
                _send(peer, kind, b"\x01")

    def _stream(self, peer: socket.socket, names: list[str], period_s: float) -> None:
        """Send a message for every cycle: a controller misses none, however late this process is given time."""
        cycle_s = time.monotonic()
        while not self.stopped.is_set():
            cycle_s = max(cycle_s + period_s, time.monotonic() - _BUFFERED_S)
            wait_s = max(0.0, cycle_s - time.monotonic())
            if select.select([peer], [], [], wait_s)[0]:
                size, kind = struct.unpack(">HB", exactly(peer, 3))
                exactly(peer, size - 3)
                _send(peer, kind, b"\x01")
                if kind == _PAUSE:
                    return
            told = self._outputs(cycle_s)
            numbers = [value for name in names for value in told[name]]
            _send(peer, _DATA, struct.pack(f">B{len(numbers)}d", 1, *numbers))


def _send(peer: socket.socket, kind: int, body: bytes) -> None:
    peer.sendall(struct.pack(">HB", 3 + len(body), kind) + body)
