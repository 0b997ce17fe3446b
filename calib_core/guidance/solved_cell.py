"""A cell by its result, edges as the walk takes them: where scanners, axes and balls are, what was captured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from calib_core.captures.content import sphere_of
from calib_core.cell.axes import (
    TABLE,
    axes_of,
    axis_of_mounts,
    moved_axes,
    names_axes,
    read_axes,
    reading_sigmas,
)
from calib_core.cell.carriers import carriers_of, scanner_mount, scanner_name
from calib_core.cell.found import as_used, mounts_of, placed_scanner, placed_table
from calib_core.cell.layout import AxisState, Layout, MovedAxis
from calib_core.cell.walk import Carriers, Position, ways
from calib_core.chain.arrays import layout_of
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.frames import FloatArray, RigidTransform, with_third
from calib_core.guidance.field_of_view import Sight, sight_of
from calib_core.guidance.prior import observations_of, sigmas_of
from calib_core.records import Capture, Cell, Measured, ResultsData, Session
from calib_core.records.results import FoundFrame
from calib_core.steps import steps_that_show, tool_stages

_SAME_BALL_MM = 10.0
_WHOLE_RAD = np.pi  # a rotary axis that was seen to move farther may stand anywhere
_SIGMA_RAD, _SIGMA_MM = 1e-4, 0.03  # of readings, where nothing is told


@dataclass(frozen=True, eq=False)
class SolvedCell:
    """What is known before further captures of a solved cell.

    Attributes
    ----------
    cell : Cell
    layout : Layout
    position : Position
        Of all edges, by the result.
    taken : list of SphereObservation
        Good captures as they would be seen without noise.
    mounts : list of str
        How each place of the layout is mounted, as captures name it.
    sights : list of Sight
        Of each scanner.
    sphere : SphereSize
    sigmas : Sigmas
    """

    cell: Cell
    layout: Layout
    position: Position
    taken: list[SphereObservation]
    mounts: list[str]
    sights: list[Sight]
    sphere: SphereSize
    sigmas: Sigmas

    @property
    def radius_mm(self) -> float:
        """The balls' radius."""
        return self.sphere.radius_mm

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Which scanner saw which place, by their places in the layout."""
        return list(dict.fromkeys(self.pair_of(one) for one in self.taken))

    def pair_of(self, seen: SphereObservation) -> tuple[int, int]:
        """Return scanner and place of what was seen."""
        scanner = self.layout.mounts.index((seen.scanner, seen.carriers.scanner))
        return scanner, self.layout.places.index((seen.carriers.ball, seen.ball))

    def rides(self, place: int) -> bool:
        """Return whether an axis carries a place."""
        return bool(self.layout.rides[place].any())

    def mount(self, scanner: int) -> RigidTransform:
        """Return a scanner's pose on what carries it."""
        rotation, shift = self.position.mount_rotations[scanner], self.position.mount_translations[scanner]
        return RigidTransform.of(rotation, shift, self.layout.mounts[scanner][1], "laser")

    def carriers(self, scanner: int, place: int) -> Carriers:
        """Return what carries a scanner and a place."""
        return Carriers(self.layout.mounts[scanner][1], self.layout.places[place][0])

    def poses_of(self, scanner: int) -> list[RigidTransform]:
        """Return where the robot stood when a scanner captured."""
        name = self.layout.mounts[scanner][0]
        return [one.base_from_tool0 for one in self.taken if one.scanner == name]

    def approach_in_laser(self, scanner: int) -> FloatArray:
        """Return the way back from a ball along a scanner's view, (3,), in L."""
        return np.array([0.0, 0.0, -float(self.sights[scanner].facing)])

    def drawn_readings(self, place: int, count: int, at_edge: float, rng: np.random.Generator) -> FloatArray:
        """Return readings of all axes, (count, axes), rad and mm: within what they were seen to move.

        Those that do not move the ball stay where they were for it; a share `at_edge` are at the ends of the ways.
        """
        found = np.zeros((count, len(self.layout.axes)))
        own = [one for one in self.taken if self.pair_of(one)[1] == place]
        for a, axis in enumerate(self.layout.axes):
            every = np.array([one.readings.get(axis.name, 0.0) for one in self.taken])
            low, high = float(every.min()), float(every.max())
            unit, edge = rng.random(count), rng.random(count) < at_edge
            if axis.kind == "rotary" and high - low > _WHOLE_RAD:
                high = low + 2 * np.pi
            else:
                unit = np.where(edge, np.round(unit), unit)
            stays = float(np.median([one.readings.get(axis.name, 0.0) for one in own]))
            found[:, a] = low + (high - low) * unit if self.moves(place, a) else stays
        return found

    def moves(self, place: int, axis: int) -> bool:
        """Return whether an axis moves a place, or the robot."""
        return bool(self.layout.rides[place, axis]) or self.layout.axes[axis].carries == "robot"

    def readings_asked(self, place: int, readings: FloatArray) -> dict[str, float]:
        """Return by name where axes are to stand for a ball; one that is not named, only where it carries it."""
        named = names_axes(self.cell)
        each = enumerate(zip(self.layout.axes, readings.tolist(), strict=True))
        return {axis.name: value for a, (axis, value) in each if named or self.moves(place, a)}

    def observation(
        self, pair: tuple[int, int], pose: RigidTransform, at: FloatArray, readings: FloatArray, name: str
    ) -> SphereObservation:
        """Return what a capture will show of a ball that is `at` (3,) in L."""
        scanner, place = pair
        seen = self.sights[scanner].observation(name, pose, at, self.radius_mm)
        names = (axis.name for axis in self.layout.axes)
        return replace(
            seen,
            carriers=self.carriers(scanner, place),
            scanner=self.layout.mounts[scanner][0],
            ball=self.layout.places[place][1],
            readings=dict(zip(names, readings.tolist(), strict=True)),
        )


def solved_cell(session: Session, measured: Sequence[Measured], results: ResultsData) -> SolvedCell | None:
    """Return a cell by the best of its results, None where none has every edge; arguments as of `known_of`."""
    cell = session.cell
    result = next((as_used(r) for stage in (*tool_stages(), "turntable") if (r := _usable(results, stage))), None)
    captures = [c for c in session.captures if c.step in _steps() and not c.excluded and c.pose is not None]
    edges = _edges(cell, session.captures)
    if result is None or (states := _axes(edges, result)) is None:
        return None
    good = {m.capture: m for m in measured if m.verdict != "fail"}
    captures = [c for c in captures if c.id in good]
    sphere, names = sphere_of(cell, []), list(dict.fromkeys(scanner_name(cell, c) for c in captures))
    sights = {name: _sight(cell, name, captures, good) for name in names}
    mounts = _mounts(cell, result, names)
    if mounts is None or not captures:
        return None
    sides = {row["capture"]: row.get("side") for r in results.values() for row in r.get("residuals", [])}
    left_out = {row["capture"] for row in result.get("residuals", []) if not row.get("used", True)}
    seen = list[SphereObservation]()
    for capture in captures:
        if capture.id in left_out:
            continue
        own = sights[scanner_name(cell, capture)]
        told = capture.model_copy(update={"side": capture.side or sides.get(capture.id)})
        seen += [_named(cell, told, one, captures) for one in observations_of(cell, [told], good, own, sphere)]
    if not seen:
        return None
    seen, places = _balls(seen, sphere, edges, mounts, states)
    layout = layout_of(seen, edges)
    in_order = [mounts[name] for name, _ in layout.mounts]
    position = Position(
        np.array([one.rotation for one in in_order]),
        np.array([one.translation_mm for one in in_order]),
        np.array([places[place] for place in layout.places]),
        tuple(states),
    )
    mounted = {(one.carriers.ball, one.ball): one.ball.partition("\n")[0] for one in seen}
    sigmas = replace(sigmas_of(cell, result), axes=_reading_sigmas(cell, edges, result))
    return SolvedCell(
        cell,
        layout,
        position,
        seen,
        [mounted[place] for place in layout.places],
        [sights[name] for name, _ in layout.mounts],
        sphere,
        sigmas,
    )


def _steps() -> tuple[str, ...]:
    return steps_that_show("sphere", "sphere-on-table")


def _usable(results: ResultsData, stage: str) -> Mapping[str, Any] | None:
    result = results.get(stage)
    return result if result and result.get("verdict") != "fail" else None


def _edges(cell: Cell, captures: Sequence[Capture]) -> tuple[MovedAxis, ...]:
    named = moved_axes(cell)
    others = [axis.name for axis in axes_of(cell, captures) if axis.name not in {one.name for one in named}]
    return (*named, *(MovedAxis(name) for name in others))


def _axes(edges: Sequence[MovedAxis], result: Mapping[str, Any]) -> list[AxisState] | None:
    """Return every axis as a result has it; None where it lacks one."""
    found = {axis["name"]: axis for axis in result.get("axes") or ()}
    states = list[AxisState]()
    for edge in edges:
        if (told := found.get(edge.name)) is not None:
            direction = np.array(told["axis_direction"], dtype=float)
            point = np.array(told["axis_point_mm"] or [0.0, 0.0, 0.0], dtype=float)
            states.append(
                AxisState(
                    with_third(direction / np.linalg.norm(direction)), point, told["direction"] * told["scale"]
                )
            )
        elif edge.name == TABLE and result.get("base_from_turntable") is not None:
            frame, encoder = placed_table(result), result.get("encoder_scale") or {}
            scale = 1.0 + (encoder["error"] if encoder.get("applied") else 0.0)
            states.append(AxisState(frame.rotation, frame.translation_mm, result.get("direction", 1) * scale))
        else:
            return None
        if not np.isfinite([*states[-1].rotation.ravel(), *states[-1].origin]).all():
            return None
    return states


def _mounts(cell: Cell, result: Mapping[str, Any], names: Sequence[str]) -> dict[str, RigidTransform] | None:
    several = mounts_of([FoundFrame.model_validate(one) for one in as_used(result).get("frames") or ()])
    found = {name: frame for name, (frame, _) in several.items()}
    first = placed_scanner(result)
    if len(names) < 2 and first is not None:
        found = dict.fromkeys(names, first)
    return found if all(name in found for name in names) else None


def _sight(cell: Cell, scanner: str, captures: Sequence[Capture], good: Mapping[str, Measured]) -> Sight:
    own = [capture for capture in captures if scanner_name(cell, capture) == scanner]
    return sight_of(cell, own, [good[capture.id] for capture in own])


def _named(
    cell: Cell, capture: Capture, seen: SphereObservation, captures: Sequence[Capture]
) -> SphereObservation:
    """Return what was seen with what carries scanner and ball, and where the axes stood."""
    carriers, readings = carriers_of(cell, capture), read_axes(cell, capture)
    if capture.step in steps_that_show("sphere-on-table"):
        of_mounts = axis_of_mounts(cell, [one for one in captures if one.step == capture.step])
        carriers = Carriers(carriers.scanner, of_mounts.get(capture.mount or "", TABLE))
    if capture.table_deg is not None and TABLE not in readings:
        readings = {**readings, TABLE: float(np.deg2rad(capture.table_deg))}
    mount = scanner_mount(cell, capture.scanner)
    return replace(
        seen,
        carriers=replace(carriers, scanner=mount),
        scanner=scanner_name(cell, capture),
        ball=capture.mount or "",
        readings=readings,
    )


def _balls(
    seen: Sequence[SphereObservation],
    sphere: SphereSize,
    edges: Sequence[MovedAxis],
    mounts: Mapping[str, RigidTransform],
    states: Sequence[AxisState],
) -> tuple[list[SphereObservation], dict[tuple[str, str], FloatArray]]:
    """Return what was seen by the name of each ball, and where balls stand: those near each other are one."""
    places = _each_place(seen, sphere, edges, mounts, states)
    named, at = list[SphereObservation](), dict[tuple[str, str], list[FloatArray]]()
    for one, place in zip(seen, places, strict=True):
        group = [key for key in at if key[0] == one.carriers.ball and key[1].partition("\n")[0] == one.ball]
        near = [key for key in group if np.linalg.norm(np.median(at[key], axis=0) - place) < _SAME_BALL_MM]
        key = near[0] if near else (one.carriers.ball, one.ball + "\n" * len(group))
        at.setdefault(key, []).append(place)
        named.append(replace(one, ball=key[1]))
    return named, {key: np.median(each, axis=0) for key, each in at.items()}


def _each_place(
    seen: Sequence[SphereObservation],
    sphere: SphereSize,
    edges: Sequence[MovedAxis],
    mounts: Mapping[str, RigidTransform],
    states: Sequence[AxisState],
) -> FloatArray:
    """Return where each capture has its ball on what carries it, (K, 3): the walk, which is affine in it, back."""
    layout = layout_of(seen, edges)
    in_order = [mounts[name] for name, _ in layout.mounts]
    walk = ways(
        layout,
        [one.base_from_tool0 for one in seen],
        [one.carriers for one in seen],
        np.array([layout.mounts.index((one.scanner, one.carriers.scanner)) for one in seen]),
        np.array([layout.places.index((one.carriers.ball, one.ball)) for one in seen]),
        np.array([[one.readings.get(axis.name, 0.0) for axis in layout.axes] for one in seen]).reshape(
            len(seen), len(layout.axes)
        ),
    )
    rotations = np.array([one.rotation for one in in_order])
    shifts = np.array([one.translation_mm for one in in_order])
    corners = [np.zeros(3), *np.eye(3)]
    zero, *ends = (
        walk.seen(Position(rotations, shifts, np.tile(corner, (len(layout.places), 1)), tuple(states)))
        for corner in corners
    )
    slopes = np.stack([end - zero for end in ends], axis=2)
    centers = np.array([one.sphere_center_in_laser_mm(sphere, one.side or 1) for one in seen])
    return np.einsum("kji,kj->ki", slopes, centers - zero)


def _reading_sigmas(cell: Cell, edges: Sequence[MovedAxis], result: Mapping[str, Any]) -> tuple[float, ...]:
    told = dict(zip((axis.name for axis in moved_axes(cell)), reading_sigmas(cell), strict=True))
    plain = sigmas_of(cell, result).angle_rad or _SIGMA_RAD
    usual = {"rotary": _SIGMA_RAD, "linear": _SIGMA_MM}
    return tuple(told.get(edge.name) or (plain if edge.name == TABLE else usual[edge.kind]) for edge in edges)
