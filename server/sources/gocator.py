"""LMI Gocator line sensors in profile mode: the data channel of their published Ethernet protocol.

Written after the manual, "Gocator Protocol: Data Results"; tried against our own server alone.
"""

import struct
from collections import deque
from typing import Final, NamedTuple

import numpy as np
from pydantic import Field

from calib_core.errors import InputError
from calib_core.messages import message
from server.sources.device import Description, Frame, host_now_s
from server.sources.source import Settings, Source
from server.sources.tcp_stream import TcpStream

HEAD: Final = struct.Struct("<IH")
"""Size of the whole message; its kind, whose highest bit says that it ends a group."""
LAST: Final = 0x8000
STAMP, POINTS, UNIFORM = 1, 5, 6
STAMPS: Final = struct.Struct("<IHBB")
STAMP_BEGIN: Final = struct.Struct("<QQ")
PROFILE: Final = struct.Struct("<HIIIIii")
MISSING: Final = -32768
_MOST_BYTES, _MOST_COLUMNS = 64_000_000, 100_000
_WAIT_S = 0.5
_MICRO, _NANO = 1e-3, 1e-6  # of a millimetre


class GocatorSettings(Settings):
    """Where the sensor's data channel is; profiles and stamps must be sent there (*Output, Ethernet*)."""

    host: str = Field(max_length=200)
    port: int = Field(default=3196, ge=1, le=65535)


class _Stamp(NamedTuple):
    frame: int
    time_s: float


class Gocator:
    """Reads profiles, one after the other, with the sensor's own count and time.

    Raises
    ------
    OSError
        If the sensor cannot be reached.
    """

    def __init__(self, settings: GocatorSettings) -> None:
        self._stream = TcpStream(settings.host, settings.port, _WAIT_S)
        self._ready: deque[Frame] = deque()
        self._frame: int | None = None

    def describe(self) -> Description:
        """Return that it delivers profiles."""
        return Description("LMI Gocator", "mm", can=("profiles", "device time"))

    def read(self) -> Frame | None:
        """Return the next profile; raises InputError where profiles were lost on the way, and reads on."""
        if not self._ready:
            try:
                self._group()
            except TimeoutError:
                return None
        return self._ready.popleft() if self._ready else None

    def close(self) -> None:
        """End the connection."""
        self._stream.close()

    def _group(self) -> None:
        """Read the messages of a group; what is neither profile nor stamp is left aside."""
        stamps: list[_Stamp] = []
        profiles: list[bytes] = []
        others: set[int] = set()
        head = self._stream.exactly(HEAD.size)
        while True:
            size, control = HEAD.unpack(head)
            if not HEAD.size <= size <= _MOST_BYTES:
                got = message("what comes is no Gocator data: a message of {size} bytes", size=size)
                raise ConnectionError(got)
            body = self._rest_of(size - HEAD.size)
            kind = control & ~LAST
            try:
                if kind == STAMP:
                    stamps = _stamps(body)
                elif kind in (POINTS, UNIFORM):
                    profiles += _profiles(body, kind)
                else:
                    others.add(kind)
            except struct.error:
                raise _unfit() from None
            if control & LAST:
                break
            head = self._rest_of(HEAD.size)
        arrived_s = host_now_s()
        for number, content in enumerate(profiles):
            stamp = stamps[number] if number < len(stamps) else None
            name = f"{stamp.frame:09d}.csv" if stamp else "profile.csv"
            self._ready.append(Frame(arrived_s, name, content, stamp.time_s if stamp else None))
        if not profiles and others - {STAMP}:
            to_do = message("Choose profile mode, and profiles as its Ethernet output.")
            raise InputError("profiles", "other messages of the sensor", to_do, "Gocator")
        self._require_no_gap([stamp.frame for stamp in stamps])

    def _rest_of(self, count: int) -> bytes:
        """Return what belongs to a group that has begun; raises OSError where it does not come."""
        try:
            return self._stream.exactly(count)
        except TimeoutError:
            raise ConnectionError(message("the sensor stopped in the middle of a profile")) from None

    def _require_no_gap(self, frames: list[int]) -> None:
        """Tell how many profiles were lost between the last one and these."""
        before, self._frame = self._frame, frames[-1] if frames else self._frame
        if frames and before is not None and frames[0] > before + 1:
            to_do = message("Lower the sensor's frame rate, or mend the network: its speed, its MTU.")
            raise InputError("every profile", "{count} lost", to_do, "Gocator", count=frames[0] - before - 1)


def _stamps(body: bytes) -> list[_Stamp]:
    count, size, _, _ = STAMPS.unpack_from(body)
    places = range(STAMPS.size, STAMPS.size + count * size, size)
    if size < STAMP_BEGIN.size or STAMPS.size + count * size > len(body):
        raise _unfit()
    return [_Stamp(frame, 1e-6 * ticks) for frame, ticks in (STAMP_BEGIN.unpack_from(body, at) for at in places)]


def _profiles(body: bytes, kind: int) -> list[bytes]:
    """Return the profiles of a message as tables of x and z in mm; what did not come back is blank."""
    attributes, count, width, x_scale, z_scale, x_offset, z_offset = PROFILE.unpack_from(body)
    numbers = 2 if kind == POINTS else 1
    begin = attributes + 2
    if not 0 < width <= _MOST_COLUMNS or begin + 2 * numbers * count * width > len(body):
        raise _unfit()
    ranges = np.frombuffer(body, "<i2", numbers * count * width, begin).reshape(count, width, numbers)
    return [
        _table(rows, x_scale * _NANO, z_scale * _NANO, x_offset * _MICRO, z_offset * _MICRO) for rows in ranges
    ]


def _table(rows: np.ndarray, x_scale: float, z_scale: float, x_offset: float, z_offset: float) -> bytes:
    steps = rows[:, 0] if rows.shape[1] == 2 else np.arange(len(rows))
    x, z = steps * x_scale + x_offset, rows[:, -1] * z_scale + z_offset
    there = (rows != MISSING).all(axis=1)
    lines = [f"{a:.5f},{b:.5f}\n" if known else ",\n" for a, b, known in zip(x, z, there, strict=True)]
    return ("x_mm,z_mm\n" + "".join(lines)).encode()


def _unfit() -> InputError:
    to_do = message("Look at the firmware: this reads the protocol of Gocator 4 to 6.")
    return InputError("a message whose sizes fit", "one cut off", to_do, "Gocator")


SOURCE = Source(
    "gocator",
    "LMI Gocator (profiles)",
    "Reads profiles from a Gocator's data channel, with the sensor's own time; lost ones are told.",
    GocatorSettings,
    connect=Gocator,
    delivers=("scanner",),
    clock="every-reading",
)
