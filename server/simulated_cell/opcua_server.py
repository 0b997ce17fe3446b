"""The simulated robot and table over OPC UA, with source times."""

import threading
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any

_PERIOD_S = 0.02


class OpcUaServer:
    """Nodes under `ns=2;s=NAME` with what `values` returns: numbers, booleans or lists of numbers."""

    def __init__(self, values: Callable[[], Mapping[str, Any]], host: str = "127.0.0.1", port: int = 0) -> None:
        from asyncua import ua
        from asyncua.sync import Server

        self._values, self._ua = values, ua
        self._server: Any = Server()
        self._server.set_endpoint(f"opc.tcp://{host}:{port}/scancell")
        self._server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        index = self._server.register_namespace("scancell")
        cell = self._server.nodes.objects.add_object(index, "Cell")
        self._nodes = {
            name: cell.add_variable(f"ns={index};s={name}", name, value) for name, value in values().items()
        }
        self._server.start()
        listening = self._server.aio_obj.bserver._server  # else the port that was chosen is told nowhere
        self.port: int = listening.sockets[0].getsockname()[1]
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="OPC UA", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where it is read."""
        return f"opc.tcp://127.0.0.1:{self.port}/scancell"

    def stop(self) -> None:
        """End it."""
        self._stopped.set()
        self._thread.join()
        self._server.stop()

    def _run(self) -> None:
        while not self._stopped.wait(_PERIOD_S):
            for name, value in self._values().items():
                stamped = self._ua.DataValue(self._ua.Variant(value), SourceTimestamp=datetime.now(UTC))
                self._nodes[name].write_value(stamped)
