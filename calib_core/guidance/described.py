"""A cell that does not stand yet as the walk takes it: its edges, about where they are, and what it may do."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from calib_core.cell.axes import moved_axes, robot_on_axes
from calib_core.cell.carriers import other_end, scanner_mount
from calib_core.cell.consistency import require_consistent
from calib_core.cell.layout import AxisState, Carrier, Layout
from calib_core.cell.walk import Position, ways
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import SphereSize
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector, with_third
from calib_core.guidance.candidates import TILT_DEG
from calib_core.guidance.field_of_view import Sight
from calib_core.guidance.solved_cell import SolvedCell
from calib_core.messages import message
from calib_core.records import Cell, CellAxis, Record, Sphere
from calib_core.records.described import DescribedAxis, DescribedEdges, Machine

_CENTER_MM: Final = np.array([1000.0, 0.0, 500.0])
_DOWN: Final = rotation_from_vector(np.array([np.pi, 0.0, 0.0]))
_BESIDE_MM: Final = np.array([60.0, 45.0, -30.0])  # from ball to ball
_ON_FLANGE_MM: Final = np.array([25.0, -40.0, 130.0])
_BESIDE_RAD: Final = 0.3  # from scanner to scanner
_OFF_AXIS_MM, _OFF_AXIS_SEEN_MM = 100.0, 35.0  # by a scanner on the flange; by one that stands still
_UP_MM: Final = 60.0
_POSES, _SEED = 120, 20_272


@dataclass(frozen=True, eq=False)
class CellThoughtOf(SolvedCell):
    """A cell before any capture: what a solved one has by its captures, it has by what it is told to do.

    Attributes
    ----------
    ways : (A, 2)
        Between which readings each axis moves, rad and mm.
    machine : str
    """

    ways: FloatArray
    machine: Machine

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Which scanner can see which place move."""
        feet = robot_on_axes(self.cell)
        return [
            (s, p)
            for s, (_, mount) in enumerate(self.layout.mounts)
            for p, (carrier, _) in enumerate(self.layout.places)
            if _moves_between(mount, carrier, feet)
        ]

    def poses_of(self, scanner: int) -> list[RigidTransform]:
        """Return orientations that the machine takes, along all ways that it goes."""
        rng, mount = np.random.default_rng([_SEED, scanner]), self.mount(scanner).rotation
        tilt, shifts = np.deg2rad(self.cell.limits.tilt_deg or TILT_DEG), rng.uniform(-200, 200, (_POSES, 3))
        around, size = rng.uniform(-np.pi, np.pi, (2, _POSES)), np.sqrt(rng.uniform(size=_POSES))
        found = list[RigidTransform]()
        for k in range(_POSES):
            lean = np.array([np.cos(around[0, k]), np.sin(around[0, k]), 0.0]) * tilt * size[k]
            turn = np.array([0.0, 0.0, 0.25 * around[1, k]])
            rotation = _DOWN
            if self.machine == "scara":
                rotation = rotation_from_vector(2 * turn) @ _DOWN
            elif self.machine == "arm":
                leaning = rotation_from_vector(lean) @ rotation_from_vector(turn)
                rotation = _DOWN @ mount @ leaning @ mount.T if self._moves_scanner(scanner) else _DOWN @ leaning
            shift = shifts[k] * ([1.0, 0.0, 0.0] if self.machine == "linear" else [1.0, 1.0, 1.0])
            found.append(RigidTransform.of(rotation, self._middle(scanner) + shift, "base", "tool0"))
        return found

    def _moves_scanner(self, scanner: int) -> bool:
        return self.layout.mounts[scanner][1] == "tool0"

    def _middle(self, scanner: int) -> FloatArray:
        """Return where the flange is when the scanner looks at the first ball that it can see, (3,)."""
        place = next(p for s, p in self.pairs if s == scanner)
        seen = self.mount(scanner).apply(self.sights[scanner].safest(self.radius_mm, 1.0))
        if self._moves_scanner(scanner):
            return self.position.places[place] - _DOWN @ seen
        return seen - _DOWN @ self.position.places[place]

    def drawn_readings(self, place: int, count: int, at_edge: float, rng: np.random.Generator) -> FloatArray:
        """Return readings of all axes, (count, axes), rad and mm; of those that do not move the ball, zero."""
        found = np.zeros((count, len(self.layout.axes)))
        for a in range(len(self.layout.axes)):
            if self.moves(place, a):
                unit, edge = rng.random(count), rng.random(count) < at_edge
                whole = self.layout.axes[a].kind == "rotary" and bool(np.ptp(self.ways[a]) >= 2 * np.pi)
                found[:, a] = self.ways[a, 0] + np.ptp(self.ways[a]) * np.where(
                    edge & (not whole), np.round(unit), unit
                )
        return found


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


def thought_of(
    told: DescribedEdges, cell: Cell, sight: Sight, sphere: SphereSize, sigmas: Sigmas
) -> CellThoughtOf:
    """Return a described cell about as it will stand."""
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
    places = np.array(
        [
            np.array(centers.get(name) or _usual_place(layout, states, n, off_mm))
            for n, (_, name) in enumerate(layout.places)
        ]
    )
    places = np.array([_on_its_axis(layout, states, n, place) for n, place in enumerate(places)])
    sights = [_own_sight(cell, name, sight) for name, _ in mounts]
    position = Position(np.tile(np.eye(3), (len(mounts), 1, 1)), np.zeros((len(mounts), 3)), places, tuple(states))
    moved = np.array([_ways(described[edge.name], edge.name in rotary[-1:]) for edge in edges]).reshape(-1, 2)
    mounted = ["" if on in ("base", "tool0") else name for on, name in layout.places]
    found = CellThoughtOf(
        cell=cell, layout=layout, position=position, taken=[], mounts=mounted, sights=sights, sphere=sphere,
        sigmas=sigmas, ways=moved, machine=told.machine,
    )  # fmt: skip
    turned = [_mounted(found, s) for s in range(len(mounts))]
    rotations, shifts = np.array([r for r, _ in turned]), np.array([t for _, t in turned])
    return replace(found, position=replace(position, mount_rotations=rotations, mount_translations=shifts))


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
    at = [0.0, 0.0, 0.0] if axis.carries == "robot" else (_CENTER_MM - [0.0, 0.0, 100.0]).tolist()
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
        return _CENTER_MM + len(before) * _BESIDE_MM
    which = [axis.name for axis in layout.axes].index(carrier)
    up = [0.0, 0.0, _UP_MM + (22.0 if off_mm == _OFF_AXIS_SEEN_MM else 100.0) * (len(before) % 2)]
    around = rotation_from_vector(np.array([0.0, 0.0, 2.2 * len(before)])) @ [off_mm, 0.0, 0.0]
    return states[which].origin + around + up


def _on_its_axis(layout: Layout, states: Sequence[AxisState], place: int, in_base: FloatArray) -> FloatArray:
    """Return a place in base, (3,), in the frame of a rotary axis that carries it."""
    for a in np.flatnonzero(layout.owns[place]).tolist():
        return states[a].rotation.T @ (in_base - states[a].origin)
    return in_base


def _own_sight(cell: Cell, scanner: str, sight: Sight) -> Sight:
    field = (cell.scanners or {})[scanner].field_of_view if scanner else None
    if field is None:
        return sight
    return replace(
        sight,
        near_mm=field.near_mm,
        far_mm=field.far_mm,
        near_half_width_mm=field.near_width_mm / 2,
        far_half_width_mm=(field.far_width_mm or field.near_width_mm) / 2,
    )


def _mounted(known: CellThoughtOf, scanner: int) -> tuple[FloatArray, FloatArray]:
    """Return about where a scanner is on what carries it, R (3, 3) and T (3,)."""
    sight, layout = known.sights[scanner], known.layout
    middle = sight.middle_mm
    if layout.mounts[scanner][1] == "tool0":
        beside = sum(on == "tool0" for _, on in layout.mounts[:scanner]) * _BESIDE_RAD
        turned = rotation_from_vector(np.array([0.0, beside, 0.0]))
        first = rotation_from_vector(np.array([0.3, 0.0, 0.0]))
        return first @ turned, first @ (middle - turned @ middle) + [110.0, 0.0, 110.0]
    aside = rotation_from_vector(np.array([0.0, 0.0, 0.5 + 0.8 * scanner]))
    riding = [p for s, p in known.pairs if s == scanner and known.rides(p)]
    if not riding:
        looking = aside @ rotation_from_vector(np.array([0.0, -2.0, 0.0]))
        return looking, _CENTER_MM - looking @ middle
    at = np.concatenate([_where(known, scanner, place) for place in riding])
    aim = (at.min(axis=0) + at.max(axis=0)) / 2
    toward = aside[:, 0]  # z of L, level; its plane of light lies flat, so that a ball on a table stays in it
    looking = np.column_stack([np.cross([0.0, 0.0, 1.0], toward), [0.0, 0.0, 1.0], toward])
    if len(riding) == 1:
        middle = sight.safest(known.radius_mm, 1.0) * [0.0, 1.0, 0.0] + middle
    return looking, aim - looking @ middle


def _where(known: CellThoughtOf, scanner: int, place: int) -> FloatArray:
    """Return where axes bring a ball, (N, 3) in base."""
    readings = known.drawn_readings(place, 200, 0.5, np.random.default_rng(_SEED))
    robot = [RigidTransform.identity("base", "tool0")] * len(readings)
    each = np.full(len(readings), scanner), np.full(len(readings), place)
    carriers = [known.carriers(scanner, place)] * len(readings)
    return ways(known.layout, robot, carriers, *each, readings).balls(known.position)[0]
