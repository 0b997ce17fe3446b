"""The axes of a cell as its record tells them, the turntable among them, and where they stood."""

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from calib_core.cell.carriers import stands_still
from calib_core.cell.layout import TABLE, MovedAxis
from calib_core.records import Capture, Cell, CellAxis
from calib_core.steps import steps_that_show


def frame_of(carrier: str) -> str:
    """Return the frame of what carries something: an axis's is the one that it moves, any other its own."""
    return "turntable" if carrier == TABLE else carrier


def axes_of(cell: Cell, captures: Sequence[Capture] = ()) -> tuple[CellAxis, ...]:
    """Return a cell's axes, the turntable last where it is not named among them."""
    named = tuple(cell.axes or ())
    on_table = steps_that_show("sphere-on-table")
    turned = (one.table_deg is not None or (not named and one.step in on_table) for one in captures)
    if any(axis.name == TABLE for axis in named):
        return named
    if cell.known.base_from_turntable is None and not any(turned):
        return named
    told = cell.turntable
    return (
        *named,
        CellAxis(
            name=TABLE,
            kind="rotary",
            on="base",
            direction=told.direction,
            sigma_deg=told.angle_sigma_deg,
            encoder=told.encoder,
        ),
    )


def carrier_of_axis(axis: CellAxis, axes: Sequence[CellAxis]) -> str:
    """Return what an axis stands on: what it says, else the axis before it that carries the same, else base."""
    before = [one.name for one in axes[: axes.index(axis)] if one.carries == axis.carries]
    return axis.on or (before[-1] if before else "base")


def moved_axes(cell: Cell) -> tuple[MovedAxis, ...]:
    """Return the axes that a cell names, as the walk takes them, each after the one that it stands on.

    Those that lead nowhere, which `require_consistent` names, are taken as if they stood on base.
    """
    axes = tuple(cell.axes or ())
    waiting, given = [*axes], list[MovedAxis]()
    while waiting:
        known = {"base", *(one.name for one in given)}
        axis = next((one for one in waiting if carrier_of_axis(one, axes) in known), waiting[0])
        under = carrier_of_axis(axis, axes)
        waiting.remove(axis)
        on = under if under in known else "base"
        given.append(MovedAxis(axis.name, axis.kind, axis.carries, on, axis.direction))
    return tuple(given)


def with_direction(cell: Cell, name: str, direction: Literal[1, -1]) -> dict[str, object]:
    """Return the merge patch of a cell by which an axis turns the way it does."""
    turned = {name: {"direction": direction}}
    axes = [
        axis.model_dump(mode="json", exclude_none=True) | turned.get(axis.name, {}) for axis in cell.axes or ()
    ]
    return {"axes": axes}


def foot_moved(cell: Cell, where: Mapping[str, float]) -> bool:
    """Return whether an axis under the robot is away from zero, by the readings of all axes."""
    return any(axis.carries == "robot" and where.get(axis.name) for axis in cell.axes or ())


def reading_sigmas(cell: Cell) -> tuple[float | None, ...]:
    """Return the standard deviations that are told of the readings of `moved_axes`, rad and mm."""
    told = {axis.name: axis for axis in cell.axes or ()}
    axes = [told[axis.name] for axis in moved_axes(cell)]
    return tuple(a.sigma_mm if a.kind == "linear" else _radians(a.sigma_deg) for a in axes)


def scales_asked(cell: Cell) -> tuple[bool | None, ...]:
    """Return of `moved_axes` whether each one's scale is sought (False: never; None: where it is plainly off)."""
    told = {axis.name: axis.encoder for axis in cell.axes or ()}
    return tuple(None if told[axis.name] is None else told[axis.name] == "scale" for axis in moved_axes(cell))


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def read_axes(cell: Cell, capture: Capture) -> dict[str, float]:
    """Return where the axes that a cell names stood in a capture, in rad and mm, by their names."""
    told = readings(capture)
    return {
        axis.name: told[axis.name] if axis.kind == "linear" else math.radians(told[axis.name])
        for axis in cell.axes or ()
        if axis.name in told
    }


def axis_of_mounts(cell: Cell, captures: Sequence[Capture]) -> dict[str, str]:
    """Return which axis carries the ball of each mounting: the last one that moved between its captures.

    Of a ball that is told to be on an axis, that one and those that it stands on count alone.
    """
    carrying = [axis.name for axis in moved_axes(cell) if axis.carries == "object"]
    stands_on = {axis.name: axis.on for axis in moved_axes(cell)}
    told = {ball.name: ball.on or "" for ball in cell.spheres or []}
    found: dict[str, str] = {}
    for mount in dict.fromkeys(capture.mount or "" for capture in captures if carrying):
        way, end = list[str](), told.get(mount, "")
        while end in carrying:
            way, end = [end, *way], stands_on[end]
        stood = [readings(one) for one in captures if (one.mount or "") == mount]
        moved = [name for name in way or carrying if len({where.get(name) for where in stood}) > 1]
        found[mount] = (moved or way or carrying)[-1]
    return found


def carrier_told(cell: Cell, capture: Capture) -> str:
    """Return what carries the ball of a capture that names it as a still one, else what carries every ball told.

    Base where nothing is told.
    """
    told = {ball.name: ball.on or "base" for ball in cell.spheres or []}
    carriers = {*told.values()}
    return told.get(capture.mount or "") or (carriers.pop() if len(carriers) == 1 else "base")


def riders(cell: Cell) -> set[str]:
    """Return the balls that are told to be on an axis, by their names."""
    names = {axis.name for axis in cell.axes or ()}
    return {ball.name for ball in cell.spheres or () if ball.on in names}


def axis_that_moved(cell: Cell, captures: Sequence[Capture]) -> str | None:
    """Return the first axis that carries the object and stood elsewhere in one capture than in another."""
    read = [readings(capture) for capture in captures]
    return next(
        (
            axis.name
            for axis in cell.axes or ()
            if axis.carries == "object" and len({where[axis.name] for where in read if axis.name in where}) > 1
        ),
        None,
    )


def part_on_flange(cell: Cell, scans: Sequence[Capture]) -> bool:
    """Return whether the flange carries what is scanned.

    So it is where scanners that stand still alone scan it, one of them from several poses of the robot, while no
    axis moves: a still part would be scanned again for nothing.
    """
    some = [one for one in scans if not one.excluded]
    if not all(stands_still(cell, one) for one in some) or axis_that_moved(cell, some):
        return False
    if len({one.table_deg for one in some}) > 1 or not all(
        one.pose or one.poses or one.pose_track for one in some
    ):
        return False
    poses = {(one.scanner, repr(one.pose or one.poses or one.pose_track)) for one in some}
    return len(poses) > len({one.scanner for one in some})


def axes_needed(cell: Cell) -> set[str]:
    """Return the axes by which the robot, or a ball that is told to be on one, is moved."""
    needed = {axis.name for axis in cell.axes or [] if axis.carries == "robot"}
    needed |= {ball.on or "" for ball in cell.spheres or []}
    for axis in reversed(moved_axes(cell)):
        needed |= {axis.on} if axis.name in needed else set()
    return needed


def moves_object(cell: Cell) -> bool:
    """Return whether a cell names an axis that carries the object."""
    return any(axis.carries == "object" for axis in cell.axes or ())


def robot_on_axes(cell: Cell) -> bool:
    """Return whether a cell names an axis that carries the robot."""
    return any(axis.carries == "robot" for axis in cell.axes or ())


def names_axes(cell: Cell) -> bool:
    """Return whether a cell names its axes, beside or in place of the one turntable."""
    return bool(cell.axes)


def readings(capture: Capture) -> dict[str, float]:
    """Return where a capture's axes stood, in degrees and mm, by their names."""
    table = {} if capture.table_deg is None else {TABLE: capture.table_deg}
    return {**table, **(capture.axes_deg or {}), **(capture.axes_mm or {})}


def reading_words(cell: Cell, capture: Capture) -> str:
    """Return what a capture read of the axes that carry the object, by name where there are several."""
    units = {axis.name: "\u202fmm" if axis.kind == "linear" else "°" for axis in cell.axes or ()}
    robots = {axis.name for axis in cell.axes or () if axis.carries == "robot"}
    read = {name: value for name, value in readings(capture).items() if name not in robots}
    words = {name: f"{round(value, 2):g}{units.get(name, '°')}".replace("-", "−") for name, value in read.items()}
    return ", ".join(words.values() if len(words) < 2 else (f"{name} {value}" for name, value in words.items()))


def without_directions(cell: Cell) -> Cell:
    """Return a cell whose axes count in no sense that is told: senses are told about up, which is in base."""
    axes = cell.axes and [axis.model_copy(update={"direction": None}) for axis in cell.axes]
    table = cell.turntable.model_copy(update={"direction": None})
    return cell.model_copy(update={"axes": axes, "turntable": table})
