"""A cell that does not stand yet: its record, and about where its edges are, where nothing is told of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from calib_core.cell.axes import moved_axes, robot_on_axes
from calib_core.cell.carriers import other_end, scanner_mount
from calib_core.cell.consistency import require_consistent
from calib_core.cell.layout import AxisState, Carrier, Layout
from calib_core.errors import InputError
from calib_core.frames import FloatArray, rotation_from_vector, with_third
from calib_core.messages import message
from calib_core.records import Cell, CellAxis, Record, Sphere
from calib_core.records.described import DescribedAxis, DescribedEdges
from calib_core.records.planning import FieldOfView

CENTER_MM: Final = np.array([1000.0, 0.0, 500.0])
"""Where a ball is that stands in base, and what a scanner in base looks at."""

_BESIDE_MM: Final = np.array([60.0, 45.0, -30.0])  # from ball to ball
_ON_FLANGE_MM: Final = np.array([25.0, -40.0, 130.0])
_OFF_AXIS_MM, _OFF_AXIS_SEEN_MM = 100.0, 35.0  # by a scanner on the flange; by one that stands still
_UP_MM: Final = 60.0


@dataclass(frozen=True, eq=False)
class DescribedGeometry:
    """Edges about as they will stand.

    Attributes
    ----------
    layout : Layout
    axes : tuple of AxisState
    places : (P, 3)
    ways : (A, 2)
        Between which readings each axis moves, rad and mm.
    """

    layout: Layout
    axes: tuple[AxisState, ...]
    places: FloatArray
    ways: FloatArray

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Which scanner can see which place move, by their places in the layout."""
        feet = any(axis.carries == "robot" for axis in self.layout.axes)
        return [
            (s, p)
            for s, (_, mount) in enumerate(self.layout.mounts)
            for p, (carrier, _) in enumerate(self.layout.places)
            if _moves_between(mount, carrier, feet)
        ]


def geometry_of(told: DescribedEdges, cell: Cell) -> DescribedGeometry:
    """Return the edges of a described cell, of which `cell_of` gives the record."""
    scanners = [*(cell.scanners or [""])]
    mounts: tuple[tuple[str, Carrier], ...] = tuple((one, scanner_mount(cell, one or None)) for one in scanners)
    edges = moved_axes(cell)
    objects = [edge.name for edge in edges if edge.carries == "object"]
    placed = _balls(told, cell, [on for _, on in mounts], objects)
    layout = Layout(mounts, tuple(placed), edges)
    described = {axis.name: axis for axis in told.axes or ()}
    rotary = [edge.name for edge in edges if edge.kind == "rotary" and edge.carries == "object"]
    states = [_state(described[edge.name], edge.name in rotary[:-1]) for edge in edges]
    off_mm = _OFF_AXIS_SEEN_MM if any(on == "base" for _, on in mounts) else _OFF_AXIS_MM
    centers = {ball.name: ball.center_mm for ball in told.spheres or ()}
    usual = [_usual_place(layout, states, n, off_mm) for n in range(len(layout.places))]
    in_base = [np.array(centers.get(name) or usual[n]) for n, (_, name) in enumerate(layout.places)]
    places = np.array([_on_its_axis(layout, states, n, place) for n, place in enumerate(in_base)])
    ways = np.array([_ways(described[edge.name], edge.name in rotary[-1:]) for edge in edges]).reshape(-1, 2)
    return DescribedGeometry(layout, tuple(states), places, ways)


def field_told(cell: Cell, scanner: str) -> FieldOfView | None:
    """Return a scanner's own field of view, of several that are named."""
    return (cell.scanners or {})[scanner].field_of_view if scanner else None


def cell_of(told: DescribedEdges, **fields: object) -> Cell:
    """Return the record of a cell that is described, other fields as they are.

    Raises
    ------
    InputError
        If its edges form no tree, or a scanner sees no ball that anything moves before it.
    """
    own = {"arrangement", "scanners", "spheres", "axes"}
    edges = told.model_dump(include=own, exclude_none=True, exclude_unset=True)
    edges["axes"] = [_as_told(axis, CellAxis) for axis in told.axes or ()]
    edges["spheres"] = [_as_told(ball, Sphere) for ball in told.spheres or ()]
    cell = Cell.model_validate({**{k: v for k, v in edges.items() if v}, **fields})
    require_consistent(cell)
    feet = robot_on_axes(cell)
    for scanner in cell.scanners or {"": None}:
        mount = scanner_mount(cell, scanner or None)
        ends = [ball.on or other_end(mount) for ball in cell.spheres or ()]
        if ends and not any(_moves_between(mount, on, feet) for on in ends):
            need = message(
                "a sphere that something moves before the scanner '{scanner}'", scanner=scanner or mount
            )
            to_do = message("Put one on the flange before a scanner that stands still, else on base or an axis.")
            raise InputError(need, "none", to_do, "spheres")
    return cell


def _as_told(record: Record, kind: type[Record]) -> dict[str, object]:
    return record.model_dump(exclude_unset=True, include=set(kind.model_fields))


def _moves_between(mount: str, carrier: str, feet: bool) -> bool:
    """Return whether anything moves between what carries a scanner and a ball, by whether axes carry the robot."""
    return carrier != mount and (mount == "base" or carrier != "tool0" or feet)


def _balls(
    told: DescribedEdges, cell: Cell, mounts: Sequence[str], objects: Sequence[str]
) -> list[tuple[str, str]]:
    """Return what carries each ball, and its name: those that are told, else one for every kind of way."""
    if told.spheres:
        usual = "tool0" if mounts[0] == "base" else "base"
        return [(ball.on or usual, ball.name) for ball in cell.spheres or ()]
    still = [("base", "sphere")] if "tool0" in mounts else []
    held = [("tool0", "sphere-on-flange")] if "base" in mounts else []
    riding = [(objects[-1], name) for name in ("low", "high")] if objects else []
    return [*still, *held, *riding]


def _state(axis: DescribedAxis, carries_another: bool) -> AxisState:
    """Return about where an axis lies: as told, else upright where it turns the part, level where it tilts it."""
    usual = {("linear", "robot"): [0.0, 1.0, 0.0], ("linear", "object"): [1.0, 0.0, 0.0]}
    along = [0.0, 1.0, 0.0] if carries_another else usual.get((axis.kind, axis.carries), [0.0, 0.0, 1.0])
    direction = np.array(axis.axis_direction or along, dtype=float)
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        where = f"axes[{axis.name}].axis_direction"
        raise InputError("a direction of the axis in base", "0 0 0", "Correct it.", where)
    at = [0.0, 0.0, 0.0] if axis.carries == "robot" else (CENTER_MM - [0.0, 0.0, 100.0]).tolist()
    return AxisState(with_third(direction / length), np.array(axis.axis_point_mm or at, dtype=float))


def _ways(axis: DescribedAxis, turns_part: bool) -> FloatArray:
    between = np.array(axis.ways(180.0 if turns_part else 40.0, 500.0 if axis.carries == "robot" else 200.0))
    return np.deg2rad(between) if axis.kind == "rotary" else between


def _usual_place(layout: Layout, states: Sequence[AxisState], place: int, off_mm: float) -> FloatArray:
    """Return about where a ball is, in base as all axes read zero, or on the flange."""
    carrier = layout.places[place][0]
    before = [n for n, (other, _) in enumerate(layout.places[:place]) if other == carrier]
    if carrier == "tool0":
        return _ON_FLANGE_MM + 0.8 * len(before) * _BESIDE_MM
    if carrier == "base":
        return CENTER_MM + len(before) * _BESIDE_MM
    which = [axis.name for axis in layout.axes].index(carrier)
    up = [0.0, 0.0, _UP_MM + (22.0 if off_mm == _OFF_AXIS_SEEN_MM else 100.0) * (len(before) % 2)]
    around = rotation_from_vector(np.array([0.0, 0.0, 2.2 * len(before)])) @ [off_mm, 0.0, 0.0]
    return states[which].origin + around + up


def _on_its_axis(layout: Layout, states: Sequence[AxisState], place: int, in_base: FloatArray) -> FloatArray:
    """Return a place in base, (3,), in the frame of a rotary axis that carries it."""
    for a in np.flatnonzero(layout.owns[place]).tolist():
        return states[a].rotation.T @ (in_base - states[a].origin)
    return in_base
