"""Records of a cell that contradict themselves or the captures: one sentence each, before anything is solved."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from calib_core.cell.axes import TABLE, axes_needed, axes_of, carrier_of_axis, readings
from calib_core.errors import InputError
from calib_core.frames import FRAMES
from calib_core.messages import message, templates
from calib_core.records import Capture, Cell, CellAxis, Sphere
from calib_core.steps import steps_that_show

_LEAST_TRAVEL_MM: Final = 10.0
"""A linear axis that moved less tells no direction: its readings are in metres."""


def require_consistent(cell: Cell, captures: Sequence[Capture] = ()) -> None:
    """Refuse a cell whose edges do not form one tree, or whose captures do not fit them.

    Raises
    ------
    InputError
        Of the first contradiction, and what to do.
    """
    axes = axes_of(cell, captures)
    _require_names(cell, axes)
    _require_carriers(cell, axes)
    _require_arrangement(cell)
    _require_distances(cell)
    _require_known_frames(cell, axes)
    if captures and cell.axes:
        _require_readings(cell.axes, captures)


def _require_names(cell: Cell, axes: Sequence[CellAxis]) -> None:
    for where, names in (
        ("axes", [axis.name for axis in axes]),
        ("spheres", [ball.name for ball in cell.spheres or []]),
    ):
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            to_do = "Rename or remove one."
            raise InputError("names that differ", "'{name}' twice", to_do, f"cell.{where}", name=twice[0])
    taken = [axis.name for axis in axes if axis.name in FRAMES]
    if taken:
        need = message("a name for the axis that no frame has")
        raise InputError(need, "'{name}'", "Rename the axis.", "cell.axes", name=taken[0])


def _require_carriers(cell: Cell, axes: Sequence[CellAxis]) -> None:
    names = [axis.name for axis in axes]
    for axis in axes:
        way = [axis.name]
        while (under := carrier_of_axis(_named(axes, way[-1]), axes)) != "base":
            if under not in names:
                raise _unknown(f"axes[{way[-1]}].on", under, ["base", *names])
            if under in way:
                loop = " on ".join(f"'{name}'" for name in (*way[way.index(under) :], under))
                to_do = message("Correct `on` of one of them.")
                raise InputError("axes that lead to base", "a loop: {loop}", to_do, "cell.axes", loop=loop)
            if _named(axes, under).carries != axis.carries:
                raise InputError(
                    "axes that carry what stands on them",
                    "the axis '{name}' with `carries: {own}` on '{under}', which carries another",
                    "Correct `on` or `carries`.",
                    "cell.axes",
                    name=way[-1], own=axis.carries, under=under,
                )  # fmt: skip
            way.append(under)
    if len(feet := _ends(axes, "robot")) > 1:
        names_of = [f"'{name}'" for name in feet]
        to_do = message("Say by `on` which of them carries the other.")
        raise InputError("one axis that the robot stands on", "{names_of}", to_do, "cell.axes", names_of=names_of)
    table = () if cell.axes else (TABLE,)  # before any capture of it, too
    carriers = dict.fromkeys(("base", "tool0", *names, *table))
    for ball in cell.spheres or []:
        if ball.on is not None and ball.on not in carriers:
            raise _unknown(f"spheres[{ball.name}].on", ball.on, [*carriers])


def _ends(axes: Sequence[CellAxis], carries: str) -> list[str]:
    """Return the axes of a kind on which no other of it stands."""
    own = [axis for axis in axes if axis.carries == carries]
    under = {carrier_of_axis(axis, axes) for axis in own}
    return [axis.name for axis in own if axis.name not in under]


_SCANNERS_ON, _SPHERES_ON = templates((
    "scanners on {needed}, as the arrangement '{arrangement}' has them",
    "spheres on {needed}, as the arrangement '{arrangement}' has them",
))  # fmt: skip


def _require_arrangement(cell: Cell) -> None:
    """Refuse an arrangement beside scanners or balls that say otherwise."""
    if "arrangement" not in cell.model_fields_set:
        return
    fixed = cell.arrangement == "sphere-on-robot"
    scanners = [one.on for one in (cell.scanners or {}).values() if "on" in one.model_fields_set]
    balls = [ball.on for ball in cell.spheres or [] if ball.on is not None]
    for need, told, flange in ((_SCANNERS_ON, scanners, not fixed), (_SPHERES_ON, balls, fixed)):
        needed = "tool0" if flange else "base"
        agree = [on for on in told if (on == "tool0") == flange]
        if told and not (agree if not fixed else len(agree) == len(told)):
            other = next(on for on in told if on not in agree)
            raise InputError(
                need,
                "on {other}",
                "Leave `arrangement` out: `on` says it.",
                "cell.arrangement",
                needed=needed, arrangement=cell.arrangement, other=other,
            )  # fmt: skip


def _require_distances(cell: Cell) -> None:
    balls = {ball.name: ball for ball in cell.spheres or []}
    seen: set[frozenset[str]] = set()
    for known in cell.sphere_distances or []:
        one, other = known.between
        for name in known.between:
            if name not in balls:
                raise _unknown("sphere_distances.between", name, balls)
        pair = frozenset(known.between)
        if one == other or pair in seen:
            need = message("each distance once, between two balls")
            got = message("'{one}' and '{other}'", one=one, other=other)
            raise InputError(need, got, "Leave it out.", "cell.sphere_distances")
        seen.add(pair)
        least = (_diameter_mm(cell, balls[one]) + _diameter_mm(cell, balls[other])) / 2
        if known.mm < least:
            raise InputError(
                "balls that can be told apart: centres {least:g} mm apart or more",
                "{mm:g} mm between '{one}' and '{other}'",
                "Give the distance of their centres, in mm.",
                "cell.sphere_distances",
                least=least, mm=known.mm, one=one, other=other,
            )  # fmt: skip
        if None not in (balls[one].on, balls[other].on) and balls[one].on != balls[other].on:
            need = message("a distance between balls that one thing carries")
            got = message("'{one}' and '{other}', which are carried apart", one=one, other=other)
            raise InputError(need, got, "Leave it out.", "cell.sphere_distances")


def _diameter_mm(cell: Cell, ball: Sphere) -> float:
    return ball.diameter_mm or cell.sphere_diameter_mm or 0.0


def _require_known_frames(cell: Cell, axes: Sequence[CellAxis]) -> None:
    frames = [*FRAMES, *(axis.name for axis in axes)]
    for known in cell.known.frames or []:
        for frame in (known.into, known.outof):
            if frame not in frames:
                raise _unknown("known.frames", frame, frames)
        if known.scanner is not None and known.scanner not in (cell.scanners or {}):
            raise _unknown("known.frames.scanner", known.scanner, cell.scanners or {})


def _require_readings(axes: Sequence[CellAxis], captures: Sequence[Capture]) -> None:
    """Refuse captures that read axes otherwise than the cell has them."""
    kinds = {axis.name: axis.kind for axis in axes}
    shown = [one for one in captures if one.step in _read_in() and not one.excluded]
    for capture in shown:
        for field, kind, told in (
            ("axes_deg", "rotary", capture.axes_deg),
            ("axes_mm", "linear", capture.axes_mm),
        ):
            for name in told or {}:
                if name not in kinds:
                    raise _unknown(f"captures[{capture.id}].{field}", name, kinds)
                if kinds[name] != kind:
                    right = "axes_mm" if kind == "rotary" else "axes_deg"
                    got = message(
                        "{field} of the axis '{name}', which is {kind}", field=field, name=name, kind=kinds[name]
                    )
                    raise InputError("{right}", got, "Correct it.", f"captures[{capture.id}]", right=right)
    for axis in axes:
        read = [where[axis.name] for one in shown if axis.name in (where := readings(one))]
        if shown and not read:
            field = "axes_deg" if axis.kind == "rotary" else "axes_mm"
            to_do = message("Add {field} to the captures, or remove the axis.", field=field)
            need = "readings of the axis '{name}'"
            raise InputError(need, "none in any capture", to_do, "cell.axes", name=axis.name)
        travel = max(read, default=0.0) - min(read, default=0.0)
        if axis.kind == "linear" and 0 < travel < _LEAST_TRAVEL_MM:
            raise InputError(
                "readings of the linear axis '{name}' in mm",
                "from {low:g} to {high:g}, which looks like metres or inches",
                "Give them in mm, or move it by {least:g} mm and more.",
                "cell.axes",
                name=axis.name, low=min(read), high=max(read), least=_LEAST_TRAVEL_MM,
            )  # fmt: skip


def _read_in() -> tuple[str, ...]:
    """Return the steps in whose captures axes are read."""
    return steps_that_show("sphere", "sphere-on-table", "object")


def without_readings(cell: Cell, captures: Iterable[Capture]) -> Iterator[tuple[Capture, str]]:
    """Give the captures that lack an axis's reading, each with the axis.

    An axis that carries the object, which no tcp capture reads while others do, was left alone in all of them:
    their sphere stands in base, as beside the one turntable.
    """
    captures = list(captures)
    needed = axes_needed(cell) | {name for one in captures if one.step == "tcp" for name in readings(one)}
    for capture in captures:
        for axis in cell.axes or []:
            if axis.name not in readings(capture) and (capture.step != "tcp" or axis.name in needed):
                yield capture, axis.name
                break


def _named(axes: Sequence[CellAxis], name: str) -> CellAxis:
    return next(axis for axis in axes if axis.name == name)


def _unknown(place: str, name: str, known: Iterable[str]) -> InputError:
    place = place if place.startswith("captures") else f"cell.{place}"
    names = ", ".join(f"'{one}'" for one in known) or message("none")
    return InputError("one of {names}", "'{name}'", "Correct it.", place, names=names, name=name)
