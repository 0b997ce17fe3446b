"""KUKA: Ethernet KRL Interface, by which a program of the controller sends XML over TCP."""

import re

from pydantic import Field

from calib_core.messages import message
from server.sources.device import Description, Sample
from server.sources.kuka_xml import parse_telegram, sample_of
from server.sources.pose_settings import Host, Port, ToolAndFrame
from server.sources.source import Source
from server.sources.tcp_stream import TcpStream

_LONGEST = 8192
_WAIT_S = 0.5


class KukaEkiSettings(ToolAndFrame):
    """Where the controller listens: its configuration has it as the server, with `<EXTERNAL><TYPE>Client`.

    `table_axis` is the external axis that turns the table.
    """

    host: Host
    port: Port = 54600
    table_axis: str | None = Field(default=None, pattern=r"^E[1-6]$")


class KukaEki:
    """Receives one element after the other; line ends between them are of no meaning."""

    def __init__(self, settings: KukaEkiSettings) -> None:
        self._settings = settings
        self._stream = TcpStream(settings.host, settings.port, _WAIT_S)

    def describe(self) -> Description:
        """Return what its program may send."""
        can = ("pose", "joints", *(("table",) if self._settings.table_axis else ()))
        return Description("KUKA EKI", "mm, degrees", "kuka", "active tool in active base", can)

    def read(self) -> Sample | None:
        """Return the next element as a sample; raises InputError where it tells none."""
        text = self._stream.first(_element)
        return None if text is None else sample_of(parse_telegram(text), self._settings, self._settings.table_axis)

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()


def _element(received: bytes) -> tuple[str, bytes] | None:
    """Return the first whole element and the rest, None where it is not whole yet; raises ConnectionError."""
    start = received.find(b"<")
    name = re.match(rb"<([A-Za-z_][\w.-]*)", received[start:]) if start >= 0 else None
    if name is not None:
        closed = re.compile(
            rb"<" + re.escape(name.group(1)) + rb"(?:\s[^<>]*)?/>|</" + re.escape(name.group(1)) + rb"\s*>"
        )
        end = closed.search(received, start)
        if end is not None:
            return received[start : end.end()].decode("utf-8", errors="replace"), received[end.end() :]
    if len(received) > _LONGEST:
        raise ConnectionError(message("the controller sends something else than elements of XML"))
    return None


SOURCE = Source(
    "kuka-eki",
    "KUKA: EKI",
    "Receives the robot's pose, joints and external axes as XML that a KRL program sends.",
    KukaEkiSettings,
    connect=KukaEki,
    delivers=("robot", "table"),
    clock="every-reading",
)
