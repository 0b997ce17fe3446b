"""KUKA: Robot Sensor Interface, received alone.

The controller sends an XML telegram by UDP each cycle of 4 or 12 ms.  With `ONLYSEND` TRUE in its configuration it
awaits no answer, and gets none here: nothing can move it.
"""

import socket

from pydantic import Field

from server.hosts import HostName
from server.sources.device import Description, Sample
from server.sources.kuka_xml import parse_telegram, sample_of
from server.sources.pose_settings import Port, ToolAndFrame
from server.sources.source import Source

_LARGEST = 65535
_WAIT_S = 0.5


class KukaRsiSettings(ToolAndFrame):
    """Where the controller's telegrams arrive: `IP_NUMBER` and `PORT` of its configuration, with `ONLYSEND` TRUE.

    `robot` is the controller's address: telegrams of others are left out.  `table_axis` is the external axis that
    turns the table (DEF_EIPos).
    """

    host: HostName = Field(
        default="0.0.0.0", max_length=255, description="This computer's address towards the robot."
    )
    port: Port = 49152
    robot: str | None = Field(default=None, max_length=64)
    table_axis: str | None = Field(default=None, pattern=r"^E[1-6]$")


class KukaRsi:
    """Receives telegrams; of several that wait, the newest counts, and IPOC is the device's time."""

    def __init__(self, settings: KukaRsiSettings) -> None:
        self._settings = settings
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((settings.host, settings.port))
        except OSError:
            self._socket.close()
            raise

    def describe(self) -> Description:
        """Return what the controller sends."""
        can = ("pose", "joints", "device time", *(("table",) if self._settings.table_axis else ()))
        return Description("KUKA RSI", "mm, degrees", "kuka", "active tool in active base", can)

    def read(self) -> Sample | None:
        """Return the newest telegram as a sample; raises InputError where it tells none."""
        newest = None
        self._socket.settimeout(_WAIT_S)
        try:
            while True:
                data, (address, _) = self._socket.recvfrom(_LARGEST)
                if self._settings.robot in (None, address):
                    newest = data
                self._socket.settimeout(0.0)
        except (TimeoutError, BlockingIOError):
            pass
        if newest is None:
            return None
        told = parse_telegram(newest.decode("ascii", errors="replace"))
        return sample_of(told, self._settings, self._settings.table_axis)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


SOURCE = Source(
    "kuka-rsi",
    "KUKA: RSI",
    "Receives the robot's pose, joints and external axes by the Robot Sensor Interface; answers nothing.",
    KukaRsiSettings,
    connect=KukaRsi,
    delivers=("robot", "table"),
    clock="every-reading",
)
