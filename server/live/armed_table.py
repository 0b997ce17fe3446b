"""A table that an operator has armed for one session: it is turned within limits, watched, and stopped.

It turns only while its angle is told by a source of the session.  Whatever is not as it shall be (no angle, one
outside of the limits, no progress, a stop) ends in `stop`.  This is no safety function: the machine's own is.
"""

import math
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from calib_core.errors import CalibrationError, ConflictError, InputError
from calib_core.messages import message
from calib_core.records import Record
from server.live.manager import LiveCells, require_live
from server.movers.mover import Mover
from server.movers.registry import MOVERS
from server.sources.device import Sample, host_now_s

_ANGLE_AGE_S = 0.6
_BEYOND_DEG = 0.5
_ARRIVED_DEG = 0.05
_STARTS_WITHIN_S = 3.0
_LOOK_S = 0.02
_LONGEST_S = 180.0

Angle = Annotated[float, Field(ge=-36_000, le=36_000, allow_inf_nan=False)]


class Arming(Record):
    """Which mover is armed with which settings, between which angles, and for how long."""

    mover: str = Field(max_length=64, examples=["modbus-table"])
    settings: dict[str, Any] = Field(
        default_factory=dict, examples=[{"host": "192.168.0.30", "target": 200, "start": 20, "stop": 21}]
    )
    low_deg: Angle = Field(examples=[0])
    high_deg: Angle = Field(examples=[350])
    minutes: float = Field(default=15.0, gt=0, le=60, allow_inf_nan=False, examples=[15])

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low_deg >= self.high_deg:
            raise ValueError(message("low_deg must be less than high_deg"))
        return self


class ArmedTable:
    """One mover while it is armed.

    Parameters
    ----------
    mover : Mover
        Connected.
    arming : Arming
    newest : callable
        Returns the newest sample that tells the table's angle, None where none is connected.
    tell : callable, optional
        Is told until when the table turns, inf where that is not known yet: its angle may stand meanwhile.
    """

    def __init__(
        self,
        mover: Mover,
        arming: Arming,
        newest: Callable[[], Sample | None],
        tell: Callable[[float], None] = lambda _: None,
    ) -> None:
        self._mover, self.arming, self._newest, self._tell = mover, arming, newest, tell
        self.until_s = host_now_s() + 60.0 * arming.minutes
        self.target_deg: float | None = None
        self._turning = threading.Lock()
        self._stopped = threading.Event()
        self.end: threading.Timer | None = None

    @property
    def is_armed(self) -> bool:
        """Whether its time is not over."""
        return host_now_s() < self.until_s

    def go(self, table_deg: float) -> float:
        """Turn to an angle; return the angle where the table came to rest.

        Raises
        ------
        InputError
            If the angle is outside of the limits.
        ConflictError
            If it is no longer armed, turns already, was stopped, or does not do what it shall: it is stopped then.
        """
        low, high = self.arming.low_deg, self.arming.high_deg
        if not low <= table_deg <= high:
            need = "an angle from {low:g}° to {high:g}°"
            raise InputError(need, f"{table_deg:g}°", "Stay within the limits.", "table_deg", low=low, high=high)
        if not self._turning.acquire(blocking=False):
            raise ConflictError("a table at rest", "one that turns", "Wait, or stop it.", "table_deg")
        try:
            self._stopped.clear()
            self._require_armed()
            began_deg = self._angle()
            self.target_deg = table_deg
            self._tell(math.inf)
            try:
                self._mover.go_to(table_deg)
            except OSError as error:
                raise _lost(error) from None
            return self._arrive(began_deg, table_deg)
        except BaseException:
            with suppress(OSError, CalibrationError):
                self._mover.stop()
            raise
        finally:
            self.target_deg = None
            self._tell(host_now_s())
            self._turning.release()

    def stop(self) -> None:
        """Stop the table; raises CalibrationError where the stop could not be told to it."""
        self._stopped.set()
        try:
            self._mover.stop()
        except OSError as error:
            raise _lost(error) from None

    def disarm(self) -> None:
        """Stop the table and end the connection."""
        self.until_s = 0.0
        if self.end is not None:
            self.end.cancel()
        try:
            with suppress(CalibrationError):
                self.stop()
        finally:
            self._mover.close()

    def _arrive(self, began_deg: float, target_deg: float) -> float:
        began_s = moved_s = host_now_s()
        last_deg = began_deg
        low, high = self.arming.low_deg - _BEYOND_DEG, self.arming.high_deg + _BEYOND_DEG
        while True:
            if self._stopped.wait(_LOOK_S):
                raise ConflictError("a turn to its end", "a stop", "Turn again when the way is free.")
            self._require_armed()
            angle, now_s = self._angle(), host_now_s()
            if not min(low, began_deg - _BEYOND_DEG) <= angle <= max(high, began_deg + _BEYOND_DEG):
                raise ConflictError("an angle within the limits", f"{angle:.2f}°", "It was stopped: look why.")
            if abs(angle - last_deg) > _ARRIVED_DEG:
                last_deg, moved_s = angle, now_s
            elif abs(angle - target_deg) <= _ARRIVED_DEG and self._rests():
                return angle
            if now_s - moved_s > _STARTS_WITHIN_S or now_s - began_s > _LONGEST_S:
                got = message(
                    "one that rests at {angle:.2f}°, {angle_other:.2f}° short of it",
                    angle=angle,
                    angle_other=abs(angle - target_deg),
                )
                raise ConflictError("a table that reaches its target", got, "It was stopped: look at its drive.")

    def _require_armed(self) -> None:
        if not self.is_armed:
            raise ConflictError("a table that is armed", "one whose time is over", "Arm it again.", "table-mover")

    def _rests(self) -> bool:
        sample = self._newest()
        return sample is not None and not sample.moving

    def _angle(self) -> float:
        sample = self._newest()
        if sample is None or sample.table_deg is None or host_now_s() - sample.host_time_s > _ANGLE_AGE_S:
            to_do = message("Connect a device that tells the table's angle.")
            raise ConflictError("the table's angle now", "none", to_do, "devices")
        return sample.table_deg


def _lost(error: OSError) -> ConflictError:
    to_do = message("Stop it at the machine if it turns; check address, cable and power.")
    return ConflictError("a table that answers", str(error), to_do, "table-mover")


class ArmedTables:
    """The movers that are armed, at most one a session; none is after a restart."""

    def __init__(self, cells: LiveCells) -> None:
        self._cells = cells
        self._armed: dict[str, ArmedTable] = {}

    def arm(self, session_id: str, arming: Arming) -> ArmedTable:
        """Connect a mover in place of the one that is armed; raises InputError, ConflictError."""
        entry = MOVERS.get(arming.mover, "mover")
        settings = entry.settings.parsed(arming.settings)
        require_live(self._cells, session_id)
        self.disarm(session_id)
        try:
            mover = entry.connect(settings)
        except ImportError:
            to_do = message("Install it: pip install 'scancell[{extra}]'.", extra=entry.extra)
            raise ConflictError("what {title} needs", "not installed", to_do, "mover", title=entry.title) from None
        except OSError as error:
            to_do = "Check address, cable and power."
            raise ConflictError("a table that answers", str(error), to_do, "host") from None
        armed = self._armed[session_id] = ArmedTable(
            mover, arming, lambda: self._newest(session_id), lambda turned_s: self._tell(session_id, turned_s)
        )
        armed.end = threading.Timer(60.0 * arming.minutes, self._expire, (session_id, armed))
        armed.end.daemon = True
        armed.end.start()
        return armed

    def get(self, session_id: str) -> ArmedTable | None:
        """Return what is armed for a session."""
        armed = self._armed.get(session_id)
        if armed is not None and not armed.is_armed:
            self.disarm(session_id)
            return None
        return armed

    def require(self, session_id: str) -> ArmedTable:
        """Return what is armed for a session; raises ConflictError where nothing is."""
        armed = self.get(session_id)
        if armed is None:
            to_do = message("Let an operator arm it, with limits.")
            raise ConflictError("a table that is armed", "none", to_do, "table-mover")
        return armed

    def disarm(self, session_id: str) -> None:
        """Stop and forget a session's mover."""
        armed = self._armed.pop(session_id, None)
        if armed is not None:
            armed.disarm()

    def disarm_all(self) -> None:
        """Stop and forget every mover: the server stops."""
        for session_id in list(self._armed):
            self.disarm(session_id)

    def _expire(self, session_id: str, armed: ArmedTable) -> None:
        """Its time is over: let go of its connection, unless another one was armed since."""
        if self._armed.get(session_id) is armed:
            self.disarm(session_id)

    def _tell(self, session_id: str, turned_s: float) -> None:
        if live := self._cells.live(session_id):
            live.turned_s = turned_s

    def _newest(self, session_id: str) -> Sample | None:
        live = self._cells.live(session_id)
        return live.newest_table() if live else None
