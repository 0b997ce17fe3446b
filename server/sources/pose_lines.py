"""A robot whose controller sends its pose over TCP, a line or an XML element at a time, as its brand writes it."""

from pydantic import Field

from calib_core.errors import InputError
from calib_core.records.base import PoseConvention
from calib_core.robots import parse_pose_lines
from server.hosts import HostName
from server.sources.device import Description, Sample, host_now_s
from server.sources.source import Settings, Source
from server.sources.tcp_stream import TcpStream

_WAIT_S = 0.5
_LONGEST = 4096


class PoseLinesSettings(Settings):
    """Where the controller sends its pose, and how it writes it."""

    host: HostName = Field(max_length=255)
    port: int = Field(ge=1, le=65535)
    convention: PoseConvention = "kuka"


class PoseLines:
    """Reads lines from a controller's socket; of several that wait, all."""

    def __init__(self, settings: PoseLinesSettings) -> None:
        self._settings = settings
        self._stream = TcpStream(settings.host, settings.port, _WAIT_S)

    def describe(self) -> Description:
        """Return the convention that its poses are read by."""
        convention = self._settings.convention
        return Description(
            "pose lines over TCP", "as the convention has them", convention, "flange in base", ("pose",)
        )

    def read(self) -> Sample | None:
        """Return the next line's pose; raises InputError where a line holds none."""
        text = self._stream.first(_line)
        if text is None:
            return None
        if (
            not text.replace("\t", " ").isprintable() or not text.isascii()
        ):  # numbers on both sides would run together
            to_do = "Look at the line's wiring and speed: bytes came damaged."
            raise InputError("a pose a line", repr(text[:60]), to_do)
        rows = parse_pose_lines(self._settings.convention, text)
        if len(rows) != 1 or rows[0].pose is None:
            got = rows[0].problem if rows and rows[0].problem else repr(text[:60])
            raise InputError("a pose a line", got, "Send the flange's pose alone.")
        return Sample(host_now_s(), base_from_tool0=rows[0].pose)

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()


def _line(received: bytes) -> tuple[str, bytes] | None:
    line, end, rest = received.partition(b"\n")
    if not end and len(line) > _LONGEST:
        raise InputError("a pose a line", "4 KiB without an end of line", "End each with CR LF.")
    return (line.decode("latin-1").replace('"', " ").strip(), rest) if end else None


SOURCE = Source(
    "pose-lines",
    "Robot: poses over TCP",
    "Reads the flange's pose that a controller sends line by line, as its brand writes it.",
    PoseLinesSettings,
    connect=PoseLines,
    delivers=("robot",),
)
