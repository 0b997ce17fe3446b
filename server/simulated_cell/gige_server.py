"""A GigE Vision camera: its control channel (GVCP) and its stream (GVSP), with lost packets sent again."""

import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import ConflictError
from calib_core.messages import message
from server.simulated_cell import gige_registers as at
from server.simulated_cell.gige_registers import Registers

GVCP_PORT = 3956
_KEY = 0x42
_DISCOVERY, _RESEND, _READ, _WRITE, _READ_MEMORY, _WRITE_MEMORY = 0x02, 0x40, 0x80, 0x82, 0x84, 0x86
_OK, _NOT_IMPLEMENTED, _BAD_ADDRESS, _READ_ONLY, _DENIED = 0x0000, 0x8001, 0x8003, 0x8004, 0x8006
_LEADER, _TRAILER, _PAYLOAD = 1, 2, 3
_IP_UDP_GVSP_BYTES = 36
_HEARTBEAT_S = 3.0
_KEPT_BLOCKS = 8
_LOOK_S = 0.2
_LINE_BYTES_S = 125e6
_BURST_BYTES = 48 * 1024

Expose = Callable[[float], tuple[NDArray[np.uint8], float]]
"""Takes the exposure time in µs and returns an image (H, W) and its device time in seconds."""


class GigeServer:
    """One camera at an address of this machine.

    While `is_out` is set it neither answers nor sends, as with its cable pulled.

    Raises
    ------
    ConflictError
        If something else answers as a camera at that address.
    """

    def __init__(
        self,
        expose: Expose,
        size: tuple[int, int],
        rate_hz: float = 20.0,
        address: str = "127.0.0.1",
        exposure_us: float = 5000.0,
    ) -> None:
        self._expose, self.address = expose, address
        self.registers = Registers(address, size, rate_hz, exposure_us)
        self.is_out, self._stopped, self._runs = threading.Event(), threading.Event(), threading.Event()
        self.sent = self.sent_again = 0
        self._controller: tuple[str, int] | None = None
        self._heard_s = 0.0
        self._blocks: deque[tuple[int, list[bytes]]] = deque(maxlen=_KEPT_BLOCKS)
        self._control = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._control.bind((address, GVCP_PORT))
        except OSError as error:
            self._control.close()
            to_do = message("Stop the other camera, or serve this one at another address of the loopback network.")
            need = "port {gvcp_port} at {address}"
            raise ConflictError(need, str(error), to_do, address, gvcp_port=GVCP_PORT, address=address) from None
        self._control.settimeout(_LOOK_S)
        self._stream = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._stream.bind((address, 0))
        self._stream.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 * 1024 * 1024)
        self._threads = [
            threading.Thread(target=run, name=f"GigE {run.__name__}", daemon=True)
            for run in (self._answer, self._send)
        ]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End it."""
        self._stopped.set()
        self._runs.set()
        for thread in self._threads:
            thread.join(5)
        self._control.close()
        self._stream.close()

    def _answer(self) -> None:
        while not self._stopped.is_set():
            try:
                command, peer = self._control.recvfrom(1024)
            except TimeoutError:
                self._expire()
                continue
            except OSError:  # a client's port that is closed already
                continue
            self._expire()
            if self.is_out.is_set() or len(command) < 8 or command[0] != _KEY:
                continue
            flags, kind, size, number = struct.unpack(">xBHHH", command[:8])
            if kind == _RESEND:
                self._send_again(command[8 : 8 + size])
                continue
            status, body = self._do(kind, command[8 : 8 + size], peer)
            if flags & 1 or kind == _DISCOVERY:
                with suppress(OSError):
                    self._control.sendto(struct.pack(">HHHH", status, kind + 1, len(body), number) + body, peer)

    def _do(self, kind: int, body: bytes, peer: tuple[str, int]) -> tuple[int, bytes]:
        """Return a command's status and answer."""
        if peer == self._controller:
            self._heard_s = time.monotonic()
        try:
            if kind == _DISCOVERY:
                return _OK, self.registers.read(0, at.DISCOVERY_BYTES)
            if kind == _READ:
                wanted = struct.unpack(f">{len(body) // 4}I", body)
                return _OK, b"".join(map(self.registers.read, wanted))
            if kind == _READ_MEMORY:
                address, count = struct.unpack(">IxxH", body)
                return _OK, body[:4] + self.registers.read(address, count)
            if kind == _WRITE:
                pairs = list(struct.iter_unpack(">II", body))
                for index, (address, value) in enumerate(pairs):
                    status = self._write(address, value, peer)
                    if status != _OK:
                        return status, struct.pack(">xxH", index)
                return _OK, struct.pack(">xxH", len(pairs))
            if kind == _WRITE_MEMORY:
                (address,), content = struct.unpack(">I", body[:4]), body[4:]
                words = struct.unpack(f">{len(content) // 4}I", content)
                results = [self._write(address + 4 * k, word, peer) for k, word in enumerate(words)]
                return max(results, default=_OK), struct.pack(">xxH", len(content))
        except KeyError:
            return _BAD_ADDRESS, b""
        except struct.error:
            return 0x8002, b""
        return _NOT_IMPLEMENTED, b""

    def _write(self, address: int, value: int, peer: tuple[str, int]) -> int:
        if address not in at.WRITABLE:
            self.registers.read(address)
            return _READ_ONLY
        if self._controller not in (None, peer) or (self._controller is None and address != at.CONTROL):
            return _DENIED
        if address == at.TIMESTAMP_CONTROL:
            ticks = round(time.monotonic() * at.TICKS_HZ)
            self.registers.write_bytes(at.TIMESTAMP_VALUE, struct.pack(">Q", ticks))
            return _OK
        if address == at.PACKET_SIZE and value & 0x8000_0000:
            self._fire_test_packet(value & 0xFFFF)
        self.registers.write(address, value & 0xFFFF if address == at.PACKET_SIZE else value)
        if address == at.CONTROL:
            self._controller = peer if value else None
            self._heard_s = time.monotonic()
            if not value:
                self._halt()
        if address == at.ACQUISITION:
            (self._runs.set if value else self._runs.clear)()
        return _OK

    def _expire(self) -> None:
        """Give control back where its holder has not been heard for as long as the heartbeat allows."""
        if self._controller is not None and time.monotonic() - self._heard_s > _HEARTBEAT_S:
            self._controller = None
            self.registers.write(at.CONTROL, 0)
            self._halt()

    def _halt(self) -> None:
        self._runs.clear()
        self.registers.write(at.ACQUISITION, 0)
        self.registers.write(at.LOCKED, 0)

    def _to(self) -> tuple[str, int]:
        return socket.inet_ntoa(self.registers.read(at.STREAM_ADDRESS)), self.registers.word(at.STREAM_PORT)

    def _fire_test_packet(self, size: int) -> None:
        with suppress(OSError):
            self._stream.sendto(bytes(max(size - 28, 8)), self._to())

    def _send_again(self, body: bytes) -> None:
        if len(body) < 12 or self.is_out.is_set():
            return
        number, first, last = struct.unpack(">xxHII", body[:12])
        for block, packets in list(self._blocks):
            if block == number:
                for packet in packets[first & 0xFFFFFF : min(last & 0xFFFFFF, len(packets)) + 1]:
                    self._packet(packet)
                    self.sent_again += 1

    def _send(self) -> None:
        block = 0
        next_s = time.monotonic()
        while not self._stopped.is_set():
            if not self._runs.is_set():
                self._runs.wait(_LOOK_S)
                block, next_s = 0, time.monotonic()
                continue
            image, moment_s = self._expose(self.registers.number(at.EXPOSURE))
            block = block % 0xFFFF + 1  # 0 is no block
            packets = _packets(image, moment_s, block, self.registers.word(at.PACKET_SIZE) - _IP_UDP_GVSP_BYTES)
            self._blocks.append((block, packets))
            self._send_at_line_rate(packets)
            self.sent += 1
            next_s = max(next_s + 1.0 / self.registers.number(at.FRAME_RATE), time.monotonic() - 0.5)
            self._stopped.wait(max(0.0, next_s - time.monotonic()))

    def _send_at_line_rate(self, packets: list[bytes]) -> None:
        """Send packets as a gigabit line lets them through: all at once is more than receivers' buffers hold."""
        began_s, waiting = time.monotonic(), 0
        for number, packet in enumerate(packets):
            self._packet(packet)
            waiting += len(packet)
            if waiting > _BURST_BYTES:
                due_s = began_s + number * len(packet) / _LINE_BYTES_S
                time.sleep(max(0.0, due_s - time.monotonic()))
                waiting = 0

    def _packet(self, packet: bytes) -> None:
        if not self.is_out.is_set():
            with suppress(OSError):
                self._stream.sendto(packet, self._to())


def _packets(image: NDArray[np.uint8], moment_s: float, block: int, most: int) -> list[bytes]:
    """Return leader, payload and trailer of one image."""
    height, width = image.shape
    content = image.tobytes()

    def head(kind: int, number: int) -> bytes:
        return struct.pack(">HHI", 0, block, kind << 24 | number)

    ticks = round(moment_s * at.TICKS_HZ)
    about = struct.pack(">HHQIIIIIHH", 0, 1, ticks, at.MONO8, width, height, 0, 0, 0, 0)
    packets = [head(_LEADER, 0) + about]
    for number, start in enumerate(range(0, len(content), most), start=1):
        packets.append(head(_PAYLOAD, number) + content[start : start + most])
    packets.append(head(_TRAILER, len(packets)) + struct.pack(">HHI", 0, 1, height))
    return packets
