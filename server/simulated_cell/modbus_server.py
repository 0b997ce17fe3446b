"""The simulated table over Modbus TCP: thousandths of a degree as a 32-bit integer, and whether it turns.

A target written to its register is turned to when the start's coil is set, and the stop's coil ends that.
"""

import asyncio
import threading
from collections.abc import Callable
from typing import Any

ANGLE, MOVING = 100, 10
TARGET, START, STOP = 200, 20, 21
_WRITES_COIL, _WRITES_REGISTERS = 5, 16


class ModbusServer:
    """The server of pymodbus.

    `angle` returns degrees and whether the table turns; `turn` takes a target, None to stop.
    """

    def __init__(
        self,
        angle: Callable[[], tuple[float, bool]],
        host: str = "127.0.0.1",
        port: int = 0,
        turn: Callable[[float | None], None] = lambda _: None,
    ) -> None:
        self._angle, self._turn = angle, turn
        self._target_deg = 0.0
        self.port = port
        self._started = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._server: Any = None
        self._thread = threading.Thread(target=self._run, args=(host, port), name="Modbus", daemon=True)
        self._thread.start()
        self._started.wait(10)

    def stop(self) -> None:
        """End it; once it has ended, nothing."""
        if self._loop.is_closed():
            return
        asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(5)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)
        self._loop.close()

    def _run(self, host: str, port: int) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._listen(host, port))
        self._started.set()
        self._loop.run_forever()

    async def _listen(self, host: str, port: int) -> None:
        from pymodbus.server import ModbusTcpServer
        from pymodbus.simulator import DataType, SimData, SimDevice

        async def act(code: int, start: int, address: int, count: int, registers: list[int], written: Any) -> None:
            if written is not None:
                self._write(code, address, written)
                return
            degrees, turns = self._angle()
            if code in (3, 4):
                value = round(degrees * 1000.0) & 0xFFFFFFFF
                registers[ANGLE - start : ANGLE - start + 2] = [value >> 16, value & 0xFFFF]
            elif code in (1, 2):
                registers[:] = [0xFFFF if turns else 0] * len(registers)  # sixteen coils in each

        words = [SimData(place, count=2, values=0, datatype=DataType.REGISTERS) for place in (ANGLE, TARGET)]
        coils = [SimData(0, values=[False] * 32, datatype=DataType.BITS)]
        device = SimDevice(1, simdata=(coils, coils, words, words), action=act)
        self._server = ModbusTcpServer(device, address=(host, port))
        await self._server.serve_forever(background=True)
        self.port = self._server.transport.sockets[0].getsockname()[1]

    def _write(self, code: int, address: int, written: Any) -> None:
        if code == _WRITES_REGISTERS and address == TARGET:
            value = (written[0] << 16 | written[1]) & 0xFFFFFFFF
            self._target_deg = (value - (1 << 32) * (value >> 31)) / 1000.0
        elif code == _WRITES_COIL and written[0]:
            self._turn({START: self._target_deg, STOP: None}[address])
