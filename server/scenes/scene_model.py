"""What a scene is drawn from: the session and its results in, everything placed in the robot's base out."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from calib_core.captures.content import pose_of, sphere_of
from calib_core.captures.placement import Placement, placement_of
from calib_core.cell.axes import reading_words
from calib_core.cell.carriers import diameters_by_name, rides_on_axis, stands_apart, stands_still, tells_diameter
from calib_core.cell.found import own_base
from calib_core.cell.walk import Carriers
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.graph.registry import stages
from calib_core.records import ArmTable, Capture, CaptureResidual, Cell, Measured, Result, Session
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResult
from calib_core.steps import steps_that_show, table_stages, tool_stages
from server.scenes.advice import advice_for
from server.scenes.field import TableField, table_field
from server.scenes.merged import MergedScans, scanner_on_flange
from server.scenes.optics import OpticsFacts, optics_facts
from server.scenes.scene_input import LoadPoints, SceneInput, no_points, nothing
from server.scenes.turntable import AxisLine, TableFacts, other_axes, table_facts

if TYPE_CHECKING:
    from calib_core.guidance.interim_estimate import KnownSoFar, TableSoFar
    from calib_core.review.placed_points import PlacedPoint

State = Literal["used", "rejected", "waiting"]
BY_HAND = "left out by hand"
"""The reason of what the user has excluded."""

MAX_POINTS = 200_000
_STILL = RigidTransform.identity("base", "base")
_LARGEST_SPHERE_MM = 200.0  # in radius: what a failed result says beyond it is no sphere


@dataclass(frozen=True, eq=False)
class CaptureFacts:
    """One capture in its place: where the flange stood, what it saw (N, 3) in L, and whether it counts.

    `sphere_center_in_base_mm` is where the solution expects the sphere of this capture, None before it is known;
    `base_from_laser` where its scanner was, `stands_still` whether that is on the flange or fixed in base.
    `links_in_base_mm` (N, 3) is the line along the cell's own arm, None where arm or joints are not known;
    `base_from_foot` is where the robot stood, by axes that carry it.  `base_from_turntable` is where T stood, and
    `read` what was read of the axes that carry the object, in words.  `spheres` are the balls that it may show,
    the one of the result first: centres, and radii where they are not the cell's.
    """

    id: str
    kind: str
    base_from_tool0: RigidTransform
    state: State
    reason: str
    points_in_laser_mm: FloatArray
    sphere_center_in_base_mm: FloatArray | None
    base_from_turntable: RigidTransform | None = None
    read: str = ""
    mount: str = ""
    links_in_base_mm: FloatArray | None = None
    base_from_laser: RigidTransform | None = None
    scanner: str = ""
    stands_still: bool = False
    base_from_foot: RigidTransform = _STILL
    spheres: tuple[tuple[FloatArray, float | None], ...] = ()


@dataclass(frozen=True, eq=False)
class Ball:
    """A solved ball and what carries it, base or the flange."""

    carrier: str
    center_mm: FloatArray
    captures: frozenset[str]
    radius_mm: float | None = None

    def in_base_mm(self, base_from_tool0: RigidTransform) -> FloatArray:
        """Return where it is while the flange is at a pose, (3,)."""
        return Carriers(ball=self.carrier).ball_in_base(self.center_mm, base_from_tool0)


@dataclass(frozen=True, eq=False)
class KnownHowWell:
    """Covariances: of scanner and base_from_turntable (6, 6: rx ry rz tx ty tz), of the centre (3, 3)."""

    tool: FloatArray | None = None
    sphere: FloatArray | None = None
    table: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class SceneFacts:
    """A session in the robot's base; what is not known yet is None, never guessed.

    A scanner that is known to a table alone is not tied to the base (`knows_base`): all is in a frame of its own.

    `merged` is the merged cloud, or the scans where none is stored; `scans` gives those one by one. `next_pose` is
    where the guide wants the flange next, None where it wants it nowhere.
    """

    captures: tuple[CaptureFacts, ...]
    mount_from_laser: RigidTransform | None
    sphere_center_in_base_mm: FloatArray | None
    sphere_radius_mm: float | None
    table: TableFacts | None = None
    optics: OpticsFacts | None = None
    merged: MergedScans | None = None
    scans: Callable[[], MergedScans | None] = nothing
    next_pose: RigidTransform | None = None
    uncertainty: KnownHowWell | None = None
    compared: "tuple[PlacedPoint, ...]" = ()
    so_far: "KnownSoFar | None" = None
    table_so_far: "TableSoFar | None" = None
    field: TableField | None = None
    balls: tuple[Ball, ...] = ()
    knows_base: bool = True
    axes: tuple[AxisLine, ...] = ()

    @property
    def knows_scanner(self) -> bool:
        """Whether it is known where the scanner of any capture was."""
        return self.mount_from_laser is not None or any(one.base_from_laser is not None for one in self.captures)

    def points_in_base_mm(self, capture: CaptureFacts) -> FloatArray:
        """Return the capture's points (N, 3) in the base, none before a result."""
        laser = capture.base_from_laser
        return laser.apply(capture.points_in_laser_mm) if laser else np.zeros((0, 3))

    def residuals_mm(self, capture: CaptureFacts) -> FloatArray | None:
        """Return the signed distances (N,) of the points to the solved sphere, positive outside, once known.

        None of a capture that shows another sphere, as the far one of a ball bar: its distances would be all that
        the colours can tell.
        """
        center, points = capture.sphere_center_in_base_mm, self.points_in_base_mm(capture)
        radius_mm = next((one for _, one in capture.spheres if one), self.sphere_radius_mm)
        if center is None or radius_mm is None:
            return None
        offsets_mm = np.array(
            [
                np.linalg.norm(points - at, axis=1) - (own_mm or radius_mm)
                for at, own_mm in capture.spheres or ((center, None),)
            ]
        )
        found_mm = offsets_mm[np.abs(offsets_mm).argmin(axis=0), np.arange(len(points))]
        far = len(found_mm) > 0 and float(np.median(np.abs(found_mm))) > radius_mm / 2
        return None if far else found_mm


@dataclass(frozen=True, eq=False)
class _Placing:
    """What every capture is placed by; `most` is how many of its points are kept."""

    balls: tuple[Ball, ...]
    placement: Placement | None
    cell: Cell
    table: TableFacts | None
    rows: Mapping[str, CaptureResidual]
    measured: Mapping[str, Measured]
    load: LoadPoints
    most: int
    arm: str | ArmTable | None


def scene_facts(scene: SceneInput) -> SceneFacts:
    """Return a session placed in the base.

    Captures without a usable pose of their own (a sweep's, or none where it matters) are left out.  Of all points
    of all captures at most `MAX_POINTS` are kept, evenly thinned.
    """
    results, session = scene.results, scene.session
    mount_from_laser = scanner_on_flange(session, results)
    still = next((r for n in tool_stages() if isinstance(r := results.get(n), TcpResult | ChainResult)), None)
    center = np.array(still.sphere_center_in_base_mm) if still and still.sphere_center_in_base_mm else None
    balls = _balls(session.cell, still, center)
    placement = _placement(session, results)
    optics = optics_facts(session, results)
    posed = _shown_captures(session, boards_told=optics is not None)
    placing = _Placing(
        balls,
        placement,
        session.cell,
        table_facts(session, results),
        _rows(results),
        {row.capture: row for row in scene.measured},
        scene.load_points if placement else no_points,
        MAX_POINTS // max(len(posed), 1),
        session.cell.robot.arm,
    )
    drawn = (_capture_facts(capture, placing) for capture in posed)
    captures = tuple(capture for capture in drawn if capture is not None)
    merged = scene.load_merged() or scene.load_scans()
    facts = SceneFacts(captures, mount_from_laser, center, None, placing.table, optics, merged, scene.load_scans)
    radius_mm, well = _radius_mm(session, facts), _known_how_well(results)
    advice = (scene.advise or advice_for)(scene)
    rows = advice.next_pose
    return replace(
        facts,
        sphere_radius_mm=radius_mm,
        next_pose=None if rows is None else RigidTransform.from_rounded(rows, "base", "tool0"),
        uncertainty=well,
        compared=scene.compared,
        so_far=advice.so_far,
        table_so_far=advice.table_so_far,
        field=table_field(scene),
        balls=balls,
        knows_base=placement is None or own_base(session.cell, session.captures) is None,
        axes=other_axes(session, () if placement is None else placement.axes, placing.table),
    )


def _balls(cell: Cell, still: TcpResult | ChainResult | None, center: FloatArray | None) -> tuple[Ball, ...]:
    """Return the solved balls that no axis carries; of results that list none, the one in base."""
    radii = {name: diameter_mm / 2 for name, diameter_mm in diameters_by_name(cell).items()}
    found = [
        Ball(one.carrier, np.array(one.center_mm, dtype=float), frozenset(one.captures), radii.get(one.name))
        for one in (still.spheres if still else [])
        if not rides_on_axis(one.carrier)
    ]
    known = tuple(one for one in found if np.isfinite(one.center_mm).all())
    return known if found or center is None else (Ball("base", center, frozenset()),)


def _placement(session: Session, results: Mapping[str, Result]) -> Placement | None:
    """Return where scanners and axes are, None where that is not known."""
    solved = [
        results[name].model_dump(by_alias=True) for name in (*tool_stages(), *table_stages()) if name in results
    ]
    try:
        return placement_of(session.cell, session.captures, solved)
    except InputError:  # an axis whose place the captures leave open
        return None


def _known_how_well(results: Mapping[str, Result]) -> KnownHowWell:
    """Return the covariances that count: those of the whole chain, else of the stages."""

    def block(stage: str, name: str, size: int) -> FloatArray | None:
        rows = getattr(results.get(stage), name, None)
        found = None if rows is None else np.array([row[:size] for row in rows[:size]], dtype=float)
        return found if found is not None and found.shape == (size, size) and np.isfinite(found).all() else None

    solved = "chain" if "chain" in results else "tcp"
    table = block("chain", "turntable_covariance", 6)
    return KnownHowWell(
        block(solved, "covariance", 6),
        block(solved, "sphere_center_covariance", 3),
        block("turntable", "covariance", 6) if table is None else table,
    )


def _shown_captures(session: Session, *, boards_told: bool) -> list[Capture]:
    """Return the captures that have a place of their own; of profiles that make one scan the first alone.

    Frames of boards are left out where the camera has boards to show in their stead, or where they would stand
    among the sphere's captures.
    """
    from calib_core.captures.scans import scan_groups

    scans = scan_groups([capture for capture in session.captures if capture.step == "scan"])
    first = {group.captures[0].id for group in scans}
    posed = [
        c
        for c in session.captures
        if (c.pose is not None or stands_apart(session.cell, c)) and (c.step != "scan" or c.id in first)
    ]
    others = [capture for capture in posed if capture.step not in steps_that_show("board")]
    return others if others or boards_told else posed


def _rows(results: Mapping[str, Result]) -> dict[str, CaptureResidual]:
    """Return what the results say of each capture, the whole chain before the stages."""
    rows: dict[str, CaptureResidual] = {}
    for stage in sorted(stages(), key=lambda stage: stage.is_answer):  # the answer has the last word
        rows |= {row.capture: row for row in getattr(results.get(stage.name), "residuals", [])}
    return rows


def _capture_facts(capture: Capture, placing: _Placing) -> CaptureFacts | None:
    try:
        pose = pose_of(placing.cell, capture)
    except InputError:
        return None  # the page says what is wrong with it; here it has no place
    laser, still = None, stands_still(placing.cell, capture)
    foot = _STILL
    if placing.placement is not None:
        foot = placing.placement.foot(capture)
        pose = foot @ pose
        with suppress(InputError):  # a scanner that is not solved
            mount = placing.placement.mount(capture)
            laser = mount if still else pose @ mount
    state, reason = _state(capture, placing)
    points = placing.load(capture)
    stride = -(-len(points) // max(placing.most, 1))
    table = _table_at(capture, placing)
    spheres: list[tuple[FloatArray, float | None]] = []
    if placing.table is not None and table is not None and capture.step == "turntable":
        own = getattr(placing.rows.get(capture.id), "mount", None)
        held = placing.table.held_by(capture.mount or "")
        names = sorted(held, key=lambda name: name != own)  # the one that the result tells of first
        spheres = [(table.apply(held[name]), None) for name in names]
    if capture.step in steps_that_show("sphere"):
        seen = [one for one in placing.balls if capture.id in one.captures] or placing.balls[:1]
        spheres = [(one.in_base_mm(pose), one.radius_mm) for one in seen]
    return CaptureFacts(
        id=capture.id,
        kind=capture.kind,
        base_from_tool0=pose,
        state=state,
        reason=reason,
        points_in_laser_mm=points[:: max(stride, 1)],
        sphere_center_in_base_mm=spheres[0][0] if spheres else None,
        base_from_turntable=table,
        read=reading_words(placing.cell, capture),
        mount=capture.mount or "",
        links_in_base_mm=_links_mm(placing.arm, capture),
        base_from_laser=laser,
        scanner=capture.scanner or "",
        stands_still=still,
        base_from_foot=foot,
        spheres=tuple(spheres),
    )


def _table_at(capture: Capture, placing: _Placing) -> RigidTransform | None:
    """Return where T stood at a capture, None where that is not told."""
    if placing.table is None:
        return None
    if placing.placement is not None and placing.placement.axes:
        return placing.placement.turntable_from_base(capture).inverse()
    return None if capture.table_deg is None else placing.table.turned(capture.table_deg)


def _links_mm(arm: str | ArmTable | None, capture: Capture) -> FloatArray | None:
    """Return the cell's own arm as it stood; a joint without a reading, or another arm's, leaves it out."""
    if arm is None or not capture.joints_deg:
        return None
    from calib_core.arms.kinematics import arm_of, links_mm

    try:
        return links_mm(arm_of(arm), capture.joints_deg, capture.joints_mm)
    except InputError:
        return None  # the check of the session says what is wrong with it


def _state(capture: Capture, placing: _Placing) -> tuple[State, str]:
    """Return whether a capture counts, and if not, why."""
    if capture.excluded:
        return "rejected", BY_HAND
    measured = placing.measured.get(capture.id)
    if measured is not None and measured.verdict == "fail":
        return "rejected", measured.reason or "nothing usable in it"
    row = placing.rows.get(capture.id)
    if row is None:
        return "waiting", ""
    return ("used", "") if row.used else ("rejected", row.reason or "rejected by the solver")


def _radius_mm(session: Session, facts: SceneFacts) -> float | None:
    """Return the sphere's radius: the cell's, or what the points of the used captures say."""
    if tells_diameter(session.cell):
        return sphere_of(session.cell, []).radius_mm
    offsets = [
        np.linalg.norm(facts.points_in_base_mm(c) - c.sphere_center_in_base_mm, axis=1)
        for c in facts.captures
        if c.state == "used" and c.sphere_center_in_base_mm is not None
    ]
    distances = np.concatenate([np.zeros(0), *offsets])
    radius_mm = float(np.median(distances)) if len(distances) else np.inf
    return radius_mm if radius_mm < _LARGEST_SPHERE_MM else None
