"""The link to one device: a thread that connects, reads, and connects again whatever happens to it."""

import errno
import logging
import math
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal

from calib_core.errors import CalibrationError
from calib_core.messages import Message, message
from server.live.freshness import STANDS_S, Freshness
from server.live.stream_order import StreamOrder
from server.sources.device import Description, Device, Frame, Reading, Sample, Triggered, host_now_s
from server.sources.source import Source

_REACH_MM = 20_000.0
_MOST_BYTES = 64 * 1024 * 1024

log = logging.getLogger("scancell")

Status = Literal["connecting", "live", "silent", "nonsense", "lost"]

SILENT_S = 1.5
"""A device that is connected and tells nothing for longer is called silent."""

_STREAM = 5
"""So many readings in a row, each within that time, are a stream: a folder that is looked at says when it ends."""

_RETRY_S = (0.25, 0.5, 1.0)
_MOST_NONSENSE = 50
_TELL_AGAIN_S = 10.0


@dataclass(frozen=True)
class LinkState:
    """How a link stands: its status, since when (`host_now_s`), what is wrong, and how much came over it.

    `fresh` is whether what it tells is new; `why` says why not, or what else is odd about the stream; `heard_s` is
    its last sign of life.
    """

    status: Status
    since_s: float
    problem: str
    readings: int
    refused: int
    rate_hz: float
    description: Description | None
    fresh: bool
    why: str
    heard_s: float


class Link:
    """Keeps one device connected.

    Parameters
    ----------
    name : str
    source : Source
        With `connect`.
    settings : object
        An instance of the source's settings, secrets included.
    take : callable
        Gets every reading that can be true, in this link's thread.
    lost : callable
        Is told when what came before no longer connects to what will come: the device is gone or sends nonsense.
    """

    def __init__(
        self,
        name: str,
        source: Source,
        settings: Any,
        take: Callable[[str, Reading], None],
        lost: Callable[[str], None],
    ) -> None:
        self.name, self.source = name, source
        self._settings, self._take, self._lost = settings, take, lost
        self._stopped = threading.Event()
        self._device: Device | None = None
        self._description: Description | None = None
        self._status: Status = "connecting"
        self._since_s = self._last_s = self._read_s = self._rate_from_s = host_now_s()
        self._problem = self._why = ""
        self._new_s, self._told_s = self._last_s, -_TELL_AGAIN_S
        self._freshness, self._order = Freshness(source.clock), StreamOrder()
        self._readings = self._refused = self._rate_from = self._in_a_row = self._in_stream = 0
        self._rate_hz = 0.0
        self._thread = threading.Thread(target=self._run, name=f"device {name}", daemon=True)

    @property
    def is_timed(self) -> bool:
        """Whether every reading tells when it was made."""
        return self._freshness.is_timed

    @property
    def baseline(self) -> object:
        """Another one with each clock that begins anew."""
        return self._freshness.baseline

    def start(self) -> None:
        """Connect, and read from now on."""
        self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> None:
        """Close the device; a driver that hangs is left to its daemon thread."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def trigger(self) -> bool:
        """Ask a device that is triggered for an exposure; return whether it is one."""
        device = self._device
        if not isinstance(device, Triggered):
            return False
        device.trigger()
        return True

    def state(self) -> LinkState:
        """Return how the link stands now; a device that says nothing shows as silent by the clock alone."""
        status, since_s, problem = self._status, self._since_s, self._problem
        if status in ("live", "nonsense") and host_now_s() - self._last_s > SILENT_S:
            status, since_s = "silent", self._last_s
            problem = message(
                "Connected, but nothing came for {host_now_s:.1f} s.", host_now_s=host_now_s() - self._last_s
            )
        why = self._why if status == "live" else problem or status
        if not why and host_now_s() - self._new_s > STANDS_S + SILENT_S:
            why = message("Nothing new came for {host_now_s:.1f} s.", host_now_s=host_now_s() - self._new_s)
        counts = self._readings, self._refused, self._rate_hz
        told = why or self._order.said(host_now_s())
        return LinkState(status, since_s, told or problem, *counts, self._description, not why, told, self._last_s)

    def _run(self) -> None:
        failures = 0
        while not self._stopped.is_set():
            try:
                device = self._connected()
            except Exception as error:  # drivers raise what they like
                self._fail(message("Cannot be reached: {error}", error=_sentence(error, self.source)))
            else:
                before = self._readings
                try:
                    self._read_on(device)
                except Exception as error:
                    self._fail(message("Lost: {error}", error=_sentence(error, self.source)))
                finally:
                    self._device = None
                    with suppress(Exception):
                        device.close()
                failures = 0 if self._readings > before else failures
            self._stopped.wait(_RETRY_S[min(failures, len(_RETRY_S) - 1)])
            failures += 1

    def _connected(self) -> Device:
        connect = self.source.connect
        assert connect is not None
        device = connect(self._settings)
        self._device, self._description = device, device.describe()
        self._freshness, self._order = Freshness(self.source.clock, self._freshness), StreamOrder()
        self._why = ""
        self._last_s = self._new_s = self._read_s = host_now_s()
        self._in_stream = 0
        self._set("live", "")
        return device

    def _read_on(self, device: Device) -> None:
        before: Reading | None = None
        while not self._stopped.is_set():
            try:
                reading = device.read()
            except CalibrationError as error:
                before = None
                self._refuse(str(error))
                continue
            if reading is None:
                # It was looked at, and there was nothing new: in the middle of a stream that is silence.
                if self.source.is_asked and self._in_stream < _STREAM:
                    self._last_s = self._new_s = host_now_s()
                continue
            self._last_s = host_now_s()
            self._in_stream = self._in_stream + 1 if self._last_s - self._read_s < SILENT_S else 0
            self._read_s = self._last_s
            wrong = nonsense(reading, before)
            if wrong is not None:
                before = None
                self._refuse(f"{wrong}.")
                continue
            self._in_a_row = 0
            before = reading
            self._count()
            self._set("live", "")
            if isinstance(reading, Frame):
                self._take(self.name, self._dated(reading))
            elif self._is_new(reading):
                self._take(self.name, reading)

    def _dated(self, frame: Frame) -> Frame:
        """Return an exposure, marked where it is not fresh: standstills need it so, recordings do not."""
        judged = self._freshness.judge(frame)
        if judged.why or judged.is_new:
            self._why = judged.why
        if judged.is_new:
            self._new_s = self._last_s
        return replace(frame, fresh=not self._why)

    def _is_new(self, reading: Sample) -> bool:
        """Return whether a reading tells something new; what is not fresh ends what came before it."""
        self._order.take(reading)
        judged = self._freshness.judge(reading)
        if judged.why:
            self._warn(judged.why)
            self._lost(self.name)
        if judged.why or judged.is_new:
            self._why = judged.why
        if judged.is_new:
            self._new_s = self._last_s
        return judged.is_new

    def _refuse(self, what: str) -> None:
        """Leave out what cannot be true; after much of it, connect anew."""
        self._last_s = host_now_s()
        self._refused += 1
        self._in_a_row += 1
        self._set("nonsense", message("It sent what cannot be used: {what}", what=what))
        self._lost(self.name)
        if self._in_a_row >= _MOST_NONSENSE:
            self._in_a_row = 0
            raise ConnectionError(message("it sent nothing that can be used"))

    def _count(self) -> None:
        self._readings += 1
        elapsed_s = self._last_s - self._rate_from_s
        if elapsed_s >= 1.0:
            self._rate_hz = (self._readings - self._rate_from) / elapsed_s
            self._rate_from, self._rate_from_s = self._readings, self._last_s

    def _fail(self, problem: str) -> None:
        self._rate_hz = 0.0
        self._set("lost", problem)
        self._lost(self.name)

    def _warn(self, problem: str) -> None:
        """Write into the log what is wrong, now and then: a stream may come and go many times a second."""
        if host_now_s() - self._told_s > _TELL_AGAIN_S:
            self._told_s = host_now_s()
            log.warning("device %s: %s", self.name, problem)

    def _set(self, status: Status, problem: str) -> None:
        if status != self._status:
            self._since_s = host_now_s()
            if status in ("lost", "nonsense"):
                self._warn(problem)
        self._status, self._problem = status, problem


def _of_network(error: OSError) -> str:
    """Return why nothing came over a network, nothing where the system's own words have to do."""
    if isinstance(error, ConnectionRefusedError):
        return message("nothing answers at this address and port")
    if isinstance(error, ConnectionResetError | ConnectionAbortedError | BrokenPipeError):
        return message("the other side ended the connection")
    if isinstance(error, socket.gaierror):
        return message("this name is not known in the network")
    unreached = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN)
    return message("no way in the network leads to this address") if error.errno in unreached else ""


def _sentence(error: Exception, source: Source) -> str:
    if isinstance(error, ImportError) and source.extra:
        return message(
            "this server lacks what it needs. Install it: pip install 'scancell[{extra}]'.", extra=source.extra
        )
    if isinstance(error, CalibrationError):
        return str(error)
    text: str = error.args[0] if error.args else ""
    if isinstance(error, TimeoutError):
        text = message("no answer in time")
    elif not isinstance(text, Message) and isinstance(error, OSError) and (known := _of_network(error)):
        text = known
    elif not isinstance(text, Message):
        text = (" ".join(str(error).split()) or type(error).__name__)[:200]
    return message("{text}.", text=text)


def nonsense(reading: Reading, before: Reading | None) -> str | None:
    """Return what is impossible about a reading, None where nothing is.

    Parameters
    ----------
    reading : Sample or Frame
    before : Sample, Frame or None
        The good reading before it, of the same device.
    """
    device_s = reading.device_time_s
    if device_s is not None and not math.isfinite(device_s):
        return "a device time that is not finite"
    before_s = before.device_time_s if before is not None else None
    if before_s is not None and device_s is not None and device_s < before_s:
        return message(
            "a device time that runs back, {before_s:.3f} s to {device_s:.3f} s",
            before_s=before_s,
            device_s=device_s,
        )
    if isinstance(reading, Frame):
        if not reading.content:
            return "an empty exposure"
        return "an exposure of more than 64 MiB" if len(reading.content) > _MOST_BYTES else None
    return _of_sample(reading)


def _of_sample(sample: Sample) -> str | None:
    if sample.base_from_tool0 is not None:
        place = sample.base_from_tool0.translation_mm
        if not all(map(math.isfinite, place.tolist())):
            return "a pose that is not finite numbers"
        if abs(place).max() > _REACH_MM:
            return message("a flange {place:.0f} m from the base", place=abs(place).max() / 1000)
    if sample.joints_deg is not None and not all(map(math.isfinite, sample.joints_deg)):
        return "joints that are not finite numbers"
    if sample.table_deg is not None and not math.isfinite(sample.table_deg):
        return "a table angle that is not a finite number"
    return None


class Links(dict[str, Link]):
    """The links of a live cell by their devices' names, and whose clocks are believed.

    A clock is believed of devices that were seen to leave a place together: neither was late from its start on.
    """

    def __init__(self) -> None:
        super().__init__()
        self._believed: set[object] = set()

    def of(self, *delivered: str) -> list[Link]:
        """Return the links of devices that deliver any of these."""
        return [link for link in list(self.values()) if set(delivered) & set(link.source.delivers)]

    def believe(self, together: str) -> None:
        """Believe the clocks of a device and the scanner, which just left a place together."""
        self._believed |= {link.baseline for link in self.of(together, "scanner")}

    def are_stamped(self, *delivered: str) -> bool:
        """Return whether every reading of such devices tells its time."""
        return all(link.is_timed for link in self.of(*delivered))

    def are_timed(self, *delivered: str) -> bool:
        """Return whether such devices' times tell how late their readings are."""
        return self.are_stamped(*delivered) and {link.baseline for link in self.of(*delivered)} <= self._believed
