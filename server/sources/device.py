"""What a live device is: it says what it delivers, is read until it is closed, and never moves anything."""

import time
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, runtime_checkable

from calib_core.frames import RigidTransform

Role = Literal["robot", "table", "scanner"]
"""What a device tells of: where the robot stands, where the table stands, what the scanner sees."""


Clock = Literal["every-reading", "on-change", "none"]
"""What a source's device time means: each reading has its own, a value's last change, or there is none."""


def host_now_s() -> float:
    """Return this computer's time in seconds as readings carry it; it only grows."""
    return time.monotonic()


@dataclass(frozen=True, eq=False)
class Sample:
    """Where the robot, the table, or both stood at one moment; what a device does not tell is None.

    Parameters
    ----------
    host_time_s : float
        When it arrived (`host_now_s`).
    device_time_s : float, optional
        When it was measured, by the device's own clock.
    base_from_tool0 : RigidTransform, optional
        The flange.
    joints_deg : tuple of float, optional
    table_deg : float, optional
    moving : bool, optional
        What the controller says of itself.
    active_tool, active_frame : int or str, optional
        Those that the controller had active.
    """

    host_time_s: float
    device_time_s: float | None = None
    base_from_tool0: RigidTransform | None = None
    joints_deg: tuple[float, ...] | None = None
    table_deg: float | None = None
    moving: bool | None = None
    active_tool: int | str | None = None
    active_frame: int | str | None = None


@dataclass(frozen=True, eq=False)
class Frame:
    """One exposure of a scanner or camera: a file as it would be stored.

    Parameters
    ----------
    host_time_s : float
        When it arrived (`host_now_s`).
    name : str
        With the ending of its format: `000123.csv`.
    content : bytes
    device_time_s : float, optional
        When it was exposed, by the device's own clock.
    fresh : bool
        Whether it arrived as soon as by that clock it can: else it may show where the robot was.
    """

    host_time_s: float
    name: str
    content: bytes
    device_time_s: float | None = None
    fresh: bool = True


Reading = Sample | Frame


@dataclass(frozen=True)
class Description:
    """What a connected device says of itself.

    Parameters
    ----------
    model : str
        Of the device or its program.
    units : str
        "mm, degrees", say.
    convention : str, optional
        That its poses are written in.
    frames : str
        Which frame is told in which: "flange in base".
    can : tuple of str
        "joints", "pose", "moving", "table", "profiles", "images", "trigger", "device time".
    more : mapping
        What else it tells, such as serial number or image size.
    """

    model: str
    units: str = ""
    convention: str | None = None
    frames: str = ""
    can: tuple[str, ...] = ()
    more: dict[str, Any] = field(default_factory=dict[str, Any])


class Device(Protocol):
    """A connection to a device; one thread uses it.  To configure it anew it is closed and connected again."""

    def describe(self) -> Description:
        """Return what it is and what it delivers."""
        ...

    def read(self) -> Reading | None:
        """Return the next reading, None where none came within half a second.

        Raises
        ------
        OSError
            If the connection is lost.
        CalibrationError
            If the device sent what cannot be read; it is read on.
        """
        ...

    def close(self) -> None:
        """End the connection; called once, whatever happened before."""
        ...


@runtime_checkable
class Triggered(Protocol):
    """A device that exposes when it is asked to."""

    def trigger(self) -> None:
        """Ask for one exposure; `read` returns it."""
        ...
