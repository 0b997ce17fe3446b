"""What is asked of a live cell and what it makes of it: a shot, and the capture that a standstill becomes."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from pydantic import Field

from calib_core.frames import RigidTransform
from calib_core.moment import text_of_seconds
from calib_core.records import Capture, Cell, Measured, Record, StepName, parse_capture
from calib_core.robots import to_pose
from calib_core.steps import capture_steps, steps_that_show
from server.live.recording import Recorded
from server.live.standstill import Rest
from server.sources.device import Sample, host_now_s
from server.store.audit import Act

Take = Callable[[Capture, Mapping[str, bytes]], Measured]
"""Stores a capture and returns what was measured in it; raises CalibrationError."""

LeaveOut = Callable[[str, str], object]
"""Excludes a capture by its id, and says why; raises CalibrationError."""


class CaptureSettings(Record):
    """What a live cell's captures are taken for; `automatic` takes one at each standstill at a new place.

    `mount` names how the sphere is mounted on the table, as in a capture's record.
    """

    automatic: bool = False
    step: StepName = "tcp"
    mount: str | None = Field(default=None, max_length=64)


@dataclass(frozen=True, eq=False)
class Taken:
    """A capture that is stored, and how good it is."""

    capture: str
    verdict: str
    zone: float | None
    text: str


@dataclass(eq=False)
class Shot:
    """A capture that somebody asked for.

    Parameters
    ----------
    name : str or None
        Its id; None takes the next.
    asked_s : float
        When (`host_now_s`); the robot has stood since then.
    numbers : list of float or None
        The pose that a robot's program told, in the cell's convention; None takes the robot's source.
    pose : RigidTransform or None
        The same.
    extra : mapping
        Further fields of the capture's record.
    source : str
        Who asked.
    act : Act, optional
        The same as the log of who did what has it.
    """

    name: str | None
    asked_s: float
    numbers: list[float] | None = None
    pose: RigidTransform | None = None
    extra: dict[str, Any] = field(default_factory=dict[str, Any])
    source: str = ""
    act: Act | None = None
    answer: "Future[Taken]" = field(default_factory=lambda: Future[Taken]())
    why_not: str = ""


def next_id(step: str, taken: set[str]) -> str:
    """Return the first free id of a step: p01, t01 …"""
    letter = next(one.letter for one in capture_steps() if one.name == step)
    number = 1
    while f"{letter}{number:02d}" in taken:
        number += 1
    return f"{letter}{number:02d}"


def capture_of_rest(
    cell: Cell, rest: Rest, settings: CaptureSettings, taken: set[str], shot: Shot | None, devices: str
) -> tuple[Capture, dict[str, bytes]]:
    """Return the capture of a standstill and its files; raises InputError if a field of the shot is of no use."""
    frame = rest.chosen.frame
    step = (shot.extra.get("step") if shot else None) or settings.step
    capture_id = (shot.name if shot else None) or next_id(step, taken)
    file = f"captures/{capture_id}{PurePath(frame.name).suffix.lower()}"
    still = rest.still
    told: dict[str, Any] = {
        "id": capture_id,
        "step": step,
        "kind": _kind(frame.name, cell),
        "files": [file],
        "moving": False,
        "source": (
            f"{shot.source if shot and shot.source else devices}; stood still: {still.exposures} exposures, "
            f"moved {still.movement_mm:.4f} mm beyond a noise of {still.noise_mm:.4f} mm"
        ),
    }
    if step == "turntable":
        told |= {"table_deg": rest.table_deg, "mount": settings.mount}
    told |= {
        **_taken(frame.host_time_s, shot),
        "device_time_s": frame.device_time_s,
        **_robot_fields(cell, rest.robot),
    }
    if shot is not None:
        told |= {"pose": shot.numbers} if shot.numbers else {}
        told |= shot.extra
    record = {name: value for name, value in told.items() if value is not None}
    return parse_capture(record, capture_id), {file: frame.content}


def capture_of_sweep(
    recorded: Recorded, fields: dict[str, Any], settings: CaptureSettings, taken: set[str], shot: Shot
) -> tuple[Capture, dict[str, bytes]]:
    """Return the capture of a recording and its files; raises InputError if a field of the shot is of no use."""
    step = settings.step
    capture_id = shot.name or next_id(step, taken)
    names = [f"captures/{capture_id}/{path.name}" for path in recorded.files]
    record = {
        "id": capture_id,
        "step": step,
        "kind": "sweep",
        "files": names,
        **_taken(recorded.frames[0].host_time_s, shot),
        **fields,
        **shot.extra,
    }
    if settings.mount and step in steps_that_show("sphere-on-table"):
        record["mount"] = settings.mount
    contents = {name: path.read_bytes() for name, path in zip(names, recorded.files, strict=True)}
    return parse_capture(record, capture_id), contents


def _taken(host_time_s: float, shot: Shot | None) -> dict[str, Any]:
    """Return when a reading arrived by this computer's clock, nothing where who asked for it tells it."""
    if shot is not None and "taken" in shot.extra:
        return {}
    return {"taken": text_of_seconds(time.time() - (host_now_s() - host_time_s)), "clock": "server"}


def _robot_fields(cell: Cell, sample: Sample | None) -> dict[str, Any]:
    if sample is None or sample.base_from_tool0 is None:
        return {}
    pose = [round(number, 9) for number in to_pose(cell.pose_convention, sample.base_from_tool0)]
    return {
        "pose": pose,
        "joints_deg": None if sample.joints_deg is None else list(sample.joints_deg),
        "active_tool": sample.active_tool,
        "active_frame": sample.active_frame,
    }


def _kind(name: str, cell: Cell) -> str:
    from calib_core.formats.points import usual_kind

    kind = usual_kind(name) or "profile"
    return "profile" if kind == "cloud" and cell.scanner.kind != "cloud" else kind
