"""A table that is turned over Modbus TCP: its target in a register, coils that start and stop it."""

import threading
from typing import Any, Literal

from pydantic import Field

from calib_core.errors import InputError
from calib_core.messages import message
from server.movers.mover import MoverEntry
from server.sources.modbus import modbus_client
from server.sources.pose_settings import Host, Port
from server.sources.source import Settings


class ModbusTableSettings(Settings):
    """Where the target stands, `value = (degrees − offset) / scale`, and the coils that start and stop a turn."""

    host: Host
    port: Port = 502
    device_id: int = Field(default=1, ge=0, le=255)
    target: int = Field(ge=0, le=65535, description="The holding register of the target.")
    type: Literal["int16", "uint16", "int32", "uint32", "float32", "float64"] = "int32"
    words: Literal["big", "little"] = "big"
    scale: float = Field(default=0.001, gt=0, allow_inf_nan=False)
    offset_deg: float = Field(default=0.0, allow_inf_nan=False)
    start: int = Field(ge=0, le=65535, description="The coil that starts the turn.")
    stop: int = Field(ge=0, le=65535, description="The coil that stops it.")


class ModbusTable:
    """Writes the target, then the start; a lock keeps a stop from falling between the words of another request."""

    def __init__(self, settings: ModbusTableSettings) -> None:
        self._settings, self._lock = settings, threading.Lock()
        self._client = modbus_client(settings.host, settings.port)

    def go_to(self, table_deg: float) -> None:
        """Write the target and start; raises InputError where the table refuses, OSError where it is gone."""
        chosen = self._settings
        value: float = (table_deg - chosen.offset_deg) / chosen.scale
        kind = self._client.DATATYPE[chosen.type.upper()]
        number = value if chosen.type.startswith("float") else round(value)
        try:
            words = self._client.convert_to_registers(number, kind, chosen.words)
        except Exception:  # of a number that the type cannot hold; the library raises what it likes
            got = message("{number:g}, which {type} cannot hold", number=number, type=chosen.type)
            raise InputError("an angle that fits the register", got, "Check type and scale.", "type") from None
        with self._lock:
            self._ask("target", self._client.write_registers, chosen.target, words)
            self._ask("start", self._client.write_coil, chosen.start, True)

    def stop(self) -> None:
        """Write the stop; raises as `go_to`."""
        with self._lock:
            self._ask("stop", self._client.write_coil, self._settings.stop, True)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def _ask(self, what: str, write: Any, address: int, value: Any) -> None:
        from pymodbus import ModbusException

        try:
            answer = write(address, value, device_id=self._settings.device_id)
        except ModbusException:  # the connection is gone, which the library tells in its own words
            raise ConnectionError(message("no answer in time")) from None
        if answer.isError():
            got = message("the exception {answer}", answer=getattr(answer, "exception_code", answer))
            to_do = "Check its address and the device's id."
            raise InputError("the {what} to be taken", got, to_do, what, what=what)


MOVER = MoverEntry(
    "modbus-table",
    "Modbus: table",
    "Turns the table by a register and two coils over Modbus TCP.",
    ModbusTable,
    ModbusTableSettings,
    extra="modbus",
)
