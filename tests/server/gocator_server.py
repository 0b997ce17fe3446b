"""A line sensor that speaks the Gocator's data protocol, after its public description; no device was at hand."""

import socket
import struct
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from server.simulated_cell.tcp_server import TcpServer

_INVALID = -32768
_Z_SCALE_NM, _X_SCALE_NM = 1000, 2000


class GocatorServer(TcpServer):
    """Sends profiles, so many times a second: a stamp and the points in a group.

    `expose` returns the points (N, 2) in mm, NaN where nothing came back, and the sensor's time in seconds.
    `lose` so many frames before the next one: they are counted and not sent.
    """

    def __init__(
        self,
        expose: Callable[[], tuple[NDArray[np.float64], float]],
        rate_hz: float = 20.0,
        host: str = "127.0.0.1",
        port: int = 0,
        uniform: bool = False,
    ) -> None:
        self._expose, self._period_s, self._uniform = expose, 1.0 / rate_hz, uniform
        self._frame = 0
        self.lose = 0
        super().__init__(host, port)

    def serve(self, peer: socket.socket) -> None:
        """Send group after group."""
        while not self.stopped.is_set():
            points, moment_s = self._expose()
            self._frame, self.lose = self._frame + 1 + self.lose, 0
            stamp = struct.pack("<QQqqQIII", self._frame, round(moment_s * 1e6), 0, 0, 0, 4711, 0, 0)
            head = struct.pack("<IHIHBB", 14 + len(stamp), 1, 1, len(stamp), 0, 0)
            peer.sendall(head + stamp + self._profile(points))
            time.sleep(self._period_s)

    def _profile(self, points: NDArray[np.float64]) -> bytes:
        low = np.nanmin(points, axis=0)
        x_offset_um, z_offset_um = (round(1000 * value) for value in (low[0], np.nanmean(points[:, 1])))
        x_nm = _X_SCALE_NM
        if self._uniform:
            x_nm = round(1e6 * (points[1, 0] - points[0, 0]))
            x_offset_um = round(1000 * points[0, 0])
        counts = np.column_stack(
            [
                (points[:, 0] * 1e6 - x_offset_um * 1000) / x_nm,
                (points[:, 1] * 1e6 - z_offset_um * 1000) / _Z_SCALE_NM,
            ]
        )
        whole = np.where(np.isnan(counts), _INVALID, np.round(np.nan_to_num(counts))).astype("<i2")
        whole[np.isnan(points).any(axis=1)] = _INVALID
        ranges = (whole[:, 1] if self._uniform else whole).tobytes()
        told = struct.pack("<HIIIIii", 40, 1, len(points), x_nm, _Z_SCALE_NM, x_offset_um, z_offset_um)
        told += struct.pack("<BIBH", 0, 100_000, 0, 0) + struct.pack("<ii", 2, 0)
        kind = 6 if self._uniform else 5
        return struct.pack("<IH", 6 + len(told) + len(ranges), 0x8000 | kind) + told + ranges
