"""Modbus TCP: a table's angle from a register."""

import logging
from typing import Any, Literal

from pydantic import Field

from calib_core.errors import InputError
from calib_core.messages import message
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Host, Interval, Pace, Port
from server.sources.source import Settings, Source

_WIDTH = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "float32": 2, "float64": 4}


class ModbusSettings(Settings):
    """Where the angle stands: `degrees = value × scale + offset`; `moving` is a coil, set while it turns."""

    host: Host
    port: Port = 502
    device_id: int = Field(default=1, ge=0, le=255)
    registers: Literal["holding", "input"] = "holding"
    address: int = Field(ge=0, le=65535)
    type: Literal["int16", "uint16", "int32", "uint32", "float32", "float64"] = "int32"
    words: Literal["big", "little"] = "big"
    scale: float = Field(default=0.001, allow_inf_nan=False)
    offset_deg: float = Field(default=0.0, allow_inf_nan=False)
    moving: int | None = Field(default=None, ge=0, le=65535)
    interval_s: Interval = 0.05


def modbus_client(host: str, port: int) -> Any:
    """Return a client that is connected; raises ConnectionError, and ImportError without the extra."""
    from pymodbus.client import ModbusTcpClient

    # It would write a line into the log at every attempt; what is wrong is said once, of the device.
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    client = ModbusTcpClient(host, port=port, timeout=1.0, retries=0)
    if not client.connect():
        raise ConnectionError(message("nobody answers at {host}:{port}", host=host, port=port))
    return client


class Modbus:
    """Reads the register again and again."""

    def __init__(self, settings: ModbusSettings) -> None:
        self._settings, self._pace = settings, Pace(settings.interval_s)
        self._client = modbus_client(settings.host, settings.port)

    def describe(self) -> Description:
        """Return that it tells an angle."""
        return Description(f"Modbus register {self._settings.address}", "degrees", can=("table",))

    def read(self) -> Sample | None:
        """Return the angle as of now; raises InputError where the server answers with an exception."""
        self._pace.wait()
        chosen = self._settings
        is_holding = chosen.registers == "holding"
        ask = self._client.read_holding_registers if is_holding else self._client.read_input_registers
        found = self._answer(ask, chosen.address, _WIDTH[chosen.type])
        kind = self._client.DATATYPE[chosen.type.upper()]
        value = self._client.convert_from_registers(found.registers, kind, chosen.words)
        moving = None
        if chosen.moving is not None:
            coil = self._answer(self._client.read_coils, chosen.moving, 1)
            moving = bool(coil.bits[0])
        return Sample(host_now_s(), table_deg=float(value) * chosen.scale + chosen.offset_deg, moving=moving)

    def _answer(self, ask: Any, address: int, count: int) -> Any:
        from pymodbus import ModbusException

        try:
            answer = ask(address, count=count, device_id=self._settings.device_id)
        except ModbusException:  # the connection is gone, which the library tells in its own words
            raise ConnectionError(message("no answer in time")) from None
        if answer.isError():
            got = message("the exception {answer}", answer=getattr(answer, "exception_code", answer))
            raise InputError("a register's value", got, "Check its address and the device's id.", "address")
        return answer

    def close(self) -> None:
        """Close the connection."""
        self._client.close()


SOURCE = Source(
    "modbus",
    "Modbus: table",
    "Reads the table's angle from a register over Modbus TCP.",
    ModbusSettings,
    connect=Modbus,
    delivers=("table",),
    extra="modbus",
)
