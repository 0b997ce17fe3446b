"""What a scene is drawn from: the session and its results in, everything placed in the robot's base out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Measured, Result, Session, TcpResult
from calib_core.robot_pose import parse_pose

LoadPoints = Callable[[Capture], FloatArray]
State = Literal["used", "rejected", "waiting"]

MAX_POINTS = 200_000
_STILL_SPHERE = ("tcp", "verify")  # in these steps the sphere stands still in the base


@dataclass(frozen=True, eq=False)
class SceneInput:
    """A session as its scene needs it.

    Attributes
    ----------
    session : Session
        The record with its captures.
    measured : sequence of Measured
        What was seen in the captures; those not measured yet are left out.
    results : mapping of stage name to Result
    load_points : callable
        Gives the points (N, 3) on the sphere of one capture, in L, mm; none when there are none.
    """

    session: Session
    load_points: LoadPoints
    measured: Sequence[Measured] = ()
    results: Mapping[str, Result] = field(default_factory=dict[str, Result])


@dataclass(frozen=True, eq=False)
class CaptureFacts:
    """One capture in its place: where the flange stood, what it saw (N, 3) in L, and whether it counts."""

    id: str
    kind: str
    base_from_tool0: RigidTransform
    state: State
    reason: str
    points_in_laser_mm: FloatArray
    sphere_is_still: bool


@dataclass(frozen=True, eq=False)
class SceneFacts:
    """A session in the robot's base; what is not known yet is None, never guessed."""

    captures: tuple[CaptureFacts, ...]
    tool0_from_laser: RigidTransform | None
    sphere_center_in_base_mm: FloatArray | None
    sphere_radius_mm: float | None

    def base_from_laser(self, capture: CaptureFacts) -> RigidTransform | None:
        """Return where the scanner stood at a capture, None before a result."""
        return capture.base_from_tool0 @ self.tool0_from_laser if self.tool0_from_laser else None

    def points_in_base_mm(self, capture: CaptureFacts) -> FloatArray:
        """Return the capture's points (N, 3) in the base, none before a result."""
        laser = self.base_from_laser(capture)
        return laser.apply(capture.points_in_laser_mm) if laser else np.zeros((0, 3))

    def residuals_mm(self, capture: CaptureFacts) -> FloatArray | None:
        """Return the signed distances (N,) of the points to the solved sphere, positive outside, once known."""
        if self.sphere_center_in_base_mm is None or self.sphere_radius_mm is None or not capture.sphere_is_still:
            return None
        offsets = self.points_in_base_mm(capture) - self.sphere_center_in_base_mm
        return np.linalg.norm(offsets, axis=1) - self.sphere_radius_mm


def scene_facts(scene: SceneInput) -> SceneFacts:
    """Return a session placed in the base.

    Captures without a usable pose of their own (a sweep's, or none at all) are left out.  Of all points of all
    captures at most `MAX_POINTS` are kept, evenly thinned.
    """
    tcp = scene.results.get("tcp")
    tcp = tcp if isinstance(tcp, TcpResult) else None
    matrix = tcp.tool0_from_laser if tcp else scene.session.cell.known.tool0_from_laser
    tool0_from_laser = RigidTransform.from_rounded(matrix, "tool0", "laser") if matrix else None
    posed = [capture for capture in scene.session.captures if capture.pose is not None]
    measured = {row.capture: row for row in scene.measured}
    most = MAX_POINTS // max(len(posed), 1)
    load = scene.load_points if tool0_from_laser else _no_points
    drawn = (_capture_facts(c, scene, tcp, measured.get(c.id), load, most) for c in posed)
    captures = tuple(capture for capture in drawn if capture is not None)
    center = np.array(tcp.sphere_center_in_base_mm) if tcp else None
    facts = SceneFacts(captures, tool0_from_laser, center, None)
    return SceneFacts(captures, tool0_from_laser, center, _radius_mm(scene.session, facts))


def _no_points(_: Capture) -> FloatArray:
    return np.zeros((0, 3))


def _capture_facts(
    capture: Capture,
    scene: SceneInput,
    tcp: TcpResult | None,
    measured: Measured | None,
    load: LoadPoints,
    most: int,
) -> CaptureFacts | None:
    try:
        pose = parse_pose(scene.session.cell.pose_convention, capture.pose or [], capture.id)
    except InputError:
        return None  # the page says what is wrong with it; here it has no place
    state, reason = _state(capture, tcp, measured)
    points = load(capture)
    stride = -(-len(points) // max(most, 1))
    return CaptureFacts(
        id=capture.id,
        kind=capture.kind,
        base_from_tool0=pose,
        state=state,
        reason=reason,
        points_in_laser_mm=points[:: max(stride, 1)],
        sphere_is_still=capture.step in _STILL_SPHERE,
    )


def _state(capture: Capture, tcp: TcpResult | None, measured: Measured | None) -> tuple[State, str]:
    """Return whether a capture counts, and if not, why."""
    if capture.excluded:
        return "rejected", "left out by hand"
    if measured is not None and measured.verdict == "fail":
        return "rejected", measured.reason or "nothing usable in it"
    row = next((r for r in tcp.residuals if r.capture == capture.id), None) if tcp else None
    if row is None:
        return "waiting", ""
    return ("used", "") if row.used else ("rejected", row.reason or "rejected by the solver")


def _radius_mm(session: Session, facts: SceneFacts) -> float | None:
    """Return the sphere's radius: the cell's, or what the points of the used captures say."""
    if session.cell.sphere_diameter_mm is not None:
        return session.cell.sphere_diameter_mm / 2
    if facts.sphere_center_in_base_mm is None:
        return None
    clouds = [facts.points_in_base_mm(c) for c in facts.captures if c.state == "used" and c.sphere_is_still]
    points = np.concatenate([np.zeros((0, 3)), *clouds])
    if not len(points):
        return None
    return float(np.median(np.linalg.norm(points - facts.sphere_center_in_base_mm, axis=1)))
