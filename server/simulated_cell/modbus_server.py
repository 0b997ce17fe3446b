"""The simulated table over Modbus TCP: thousandths of a degree as a 32-bit integer, and whether it turns."""

import asyncio
import threading
from collections.abc import Callable
from typing import Any

ANGLE, MOVING = 100, 10


class ModbusServer:
    """pymodbus's server; `angle` returns degrees and whether the table turns."""

    def __init__(self, angle: Callable[[], tuple[float, bool]], host: str = "127.0.0.1", port: int = 0) -> None:
        self._angle = angle
        self.port = port
        self._started = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._server: Any = None
        self._thread = threading.Thread(target=self._run, args=(host, port), name="Modbus", daemon=True)
        self._thread.start()
        self._started.wait(10)

    def stop(self) -> None:
        """End it."""
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
            degrees, turns = self._angle()
            if code in (3, 4):
                value = round(degrees * 1000.0) & 0xFFFFFFFF
                registers[ANGLE - start : ANGLE - start + 2] = [value >> 16, value & 0xFFFF]
            elif code in (1, 2):
                registers[:] = [0xFFFF if turns else 0] * len(registers)  # sixteen coils in each

        words = [SimData(ANGLE, count=2, values=0, datatype=DataType.REGISTERS)]
        coils = [SimData(0, values=[False] * 16, datatype=DataType.BITS)]
        device = SimDevice(1, simdata=(coils, coils, words, words), action=act)
        self._server = ModbusTcpServer(device, address=(host, port))
        await self._server.serve_forever(background=True)
        self.port = self._server.transport.sockets[0].getsockname()[1]
