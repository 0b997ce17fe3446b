"""A cell that does not stand yet as the walk takes it: its edges, about where they are, and what it may do."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from calib_core.cell.carriers import rides_on_axis
from calib_core.cell.described import CENTER_MM, DescribedGeometry, field_told, geometry_of
from calib_core.cell.walk import Position, ways
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import SphereSize
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector
from calib_core.guidance.candidates import TILT_DEG
from calib_core.guidance.field_of_view import Sight
from calib_core.guidance.solved_cell import SolvedCell
from calib_core.records import Cell
from calib_core.records.described import DescribedEdges, Machine

_DOWN: Final = rotation_from_vector(np.array([np.pi, 0.0, 0.0]))
_BESIDE_RAD: Final = 0.3  # from scanner to scanner
_POSES, _SEED = 120, 20_272


@dataclass(frozen=True, eq=False)
class CellThoughtOf(SolvedCell):
    """A cell before any capture: what a solved one has by its captures, it has by what it is told to do.

    Attributes
    ----------
    geometry : DescribedGeometry
    machine : str
    """

    geometry: DescribedGeometry
    machine: Machine

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Which scanner can see which place move."""
        return self.geometry.pairs

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
            across_light = [0.0, 1.0, 0.0]
            shift = shifts[k] * (across_light if self.machine == "linear" else [1.0, 1.0, 1.0])
            found.append(RigidTransform.of(rotation, self._middle(scanner) + shift, "base", "tool0"))
        return found

    def _moves_scanner(self, scanner: int) -> bool:
        return self.carriers(scanner, 0).scanner_moves

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
                whole = self.layout.axes[a].kind == "rotary" and bool(np.ptp(self.geometry.ways[a]) >= 2 * np.pi)
                found[:, a] = self.geometry.ways[a, 0] + np.ptp(self.geometry.ways[a]) * np.where(
                    edge & (not whole), np.round(unit), unit
                )
        return found


def thought_of(
    told: DescribedEdges, cell: Cell, sight: Sight, sphere: SphereSize, sigmas: Sigmas
) -> CellThoughtOf:
    """Return a described cell about as it will stand."""
    geometry = geometry_of(told, cell)
    mounts, layout = geometry.layout.mounts, geometry.layout
    still = np.tile(np.eye(3), (len(mounts), 1, 1)), np.zeros((len(mounts), 3))
    found = CellThoughtOf(
        cell=cell, layout=layout, position=Position(*still, geometry.places, geometry.axes), taken=[],
        mounts=[name if rides_on_axis(on) else "" for on, name in layout.places],
        sights=[_own_sight(cell, name, sight) for name, _ in mounts], sphere=sphere, sigmas=sigmas,
        geometry=geometry, machine=told.machine,
    )  # fmt: skip
    turned = [_mounted(found, s) for s in range(len(mounts))]
    rotations, shifts = np.array([r for r, _ in turned]), np.array([t for _, t in turned])
    return replace(found, position=replace(found.position, mount_rotations=rotations, mount_translations=shifts))


def _own_sight(cell: Cell, scanner: str, sight: Sight) -> Sight:
    field = field_told(cell, scanner)
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
    if known.carriers(scanner, 0).scanner_moves:
        on = layout.mounts[scanner][1]
        beside = sum(on == other for _, other in layout.mounts[:scanner]) * _BESIDE_RAD
        turned = rotation_from_vector(np.array([0.0, beside, 0.0]))
        first = rotation_from_vector(np.array([0.3, 0.0, 0.0]))
        return first @ turned, first @ (middle - turned @ middle) + [110.0, 0.0, 110.0]
    aside = rotation_from_vector(np.array([0.0, 0.0, 0.5 + 0.8 * scanner]))
    riding = [p for s, p in known.pairs if s == scanner and known.rides(p)]
    if not riding:
        looking = aside @ rotation_from_vector(np.array([0.0, -2.0, 0.0]))
        return looking, CENTER_MM - looking @ middle
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
