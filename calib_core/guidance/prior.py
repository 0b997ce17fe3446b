"""What is known before the next capture of the still sphere: from results, else from the captures themselves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.arms.alike import REACH_MM
from calib_core.captures.arm_joints import with_arm_moves
from calib_core.captures.content import sphere_of
from calib_core.cell.carriers import (
    ball_on_flange,
    balls_in_sight,
    tells_diameter,
)
from calib_core.cell.found import (
    SCANNER_FRAMES,
    carriers_found,
    covariance_of_several,
    known_scanner,
    of_scanner,
    placed_scanner,
    scanner_frame,
)
from calib_core.cell.in_hand import in_hand
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.chain.variance import GivenSigmas
from calib_core.errors import InputError, MeasurementError
from calib_core.frames import FloatArray, RigidTransform, vector_from_rotation
from calib_core.guidance.arm_unknowns import arm_unknowns, with_joints
from calib_core.guidance.candidates import Room
from calib_core.guidance.design import SIGMAS, Assumed, worst_sigma
from calib_core.guidance.field_of_view import Sight, sight_of
from calib_core.guidance.planner import Situation
from calib_core.guidance.scatter import GROSS, solved_quickly
from calib_core.poses.numbers import parse_pose
from calib_core.records import Capture, Cell, Measured, ResultsData, Session
from calib_core.steps import tool_stages

_LEAST_SEARCHED = 5  # captures from which tool and sphere are found whatever the motions
_GOOD_SCATTER_MM = 2.0
_LOOKED_AT = 8  # captures in which several balls would show
_LEAST_AGREEING = 3  # turned captures that agree, before others may be said to contradict them
_LEAST_TURN_RAD = np.deg2rad(5.0)
_NOMINAL_MM, _NOMINAL_DEG = 10.0, 3.0
MOST_TAKEN = 40  # captures beyond these change no advice, and would only make it slow


@dataclass(frozen=True, eq=False)
class _Place:
    """A guess of tool and sphere, how well they are known beside the captures, and whether these tell both."""

    mount_from_laser: RigidTransform
    center_mm: FloatArray
    tool_sigma_mm: float = 300.0
    tool_sigma_rad: float = 1.0
    by_captures: bool = False


@dataclass(frozen=True, eq=False)
class Contradiction:
    """Captures enough to tell tool and sphere, but none lets them agree: nothing may be promised of them."""


def situation_of(
    session: Session, measured: Sequence[Measured], results: ResultsData, step: str = "tcp"
) -> Situation | None:
    """Return what is known of tool, sphere and scanner, None where too little is for a pose to be chosen.

    The arguments are those of `known_of`.
    """
    known = known_of(session, measured, results, step)
    return known if isinstance(known, Situation) else None


def known_of(
    session: Session, measured: Sequence[Measured], results: ResultsData, step: str = "tcp"
) -> Situation | Contradiction | None:
    """Return what is known of tool, sphere and scanner, or that the captures contradict each other.

    Parameters
    ----------
    session : Session
    measured : sequence of Measured
    results : mapping
        From stage to the JSON data of its result; a stale one's tool is as good for planning.
    step : str
        Whose captures are planned. Others than "tcp" are taken away from those of the calibration.
    """
    session = in_hand(session, step)
    cell = session.cell
    if not tells_diameter(cell):
        return None
    captures = [c for c in session.captures if c.step == step and not c.excluded and c.pose is not None]
    kept = {m.capture: m for m in measured if m.verdict != "fail"}
    sight = sight_of(cell, [c for c in captures if c.id in kept], list(kept.values()))
    sphere = sphere_of(cell, [])
    solved = _solved(results)
    result = None if solved is None else of_scanner(solved, cell)
    sight = _with_alike_points(sight, result)
    seen = observations_of(cell, captures, kept, sight, sphere)
    keep_off: tuple[RigidTransform, ...] = ()
    if step == "tcp":
        seen = _used(seen, result)
        place = _place(cell, seen, sphere, result)
    else:
        keep_off = _calibration_poses(session)
        place = _to_verify(cell, seen, sphere, result)
    home = sight.carriers.ball_from_scanner(keep_off[0]).rotation if keep_off else _home(cell, seen, sight)
    if isinstance(place, Contradiction):
        return place
    covariance = covariance_of_several(cell, result or {}) if step == "tcp" else None
    if covariance is not None:
        seen = []  # a plan knows one scanner, one ball and no rail: what several told stands in the result
    if place is None or home is None:
        return None
    point = cell.workpiece_in_laser_mm
    arm = arm_unknowns(cell, captures, result) if step == "tcp" and not ball_on_flange(cell) else None
    if arm is not None:
        seen = with_arm_moves(cell, with_joints(captures), seen)
    sigmas, taken = sigmas_of(cell, result), seen[-MOST_TAKEN:]
    apart: tuple[str, ...] = ()
    workpiece = None
    at_workpiece = _middle(sight, result) if point is None else np.array(point)
    if place.by_captures and taken:
        tool, center = place.mount_from_laser, place.center_mm
        quick = solved_quickly(taken, sphere, tool, center, _given(cell), sigmas, at_workpiece)
        sigmas, apart, workpiece = quick.sigmas, quick.apart, quick.workpiece
    assumed = Assumed(
        sphere=sphere,
        mount_from_laser=place.mount_from_laser,
        center_mm=place.center_mm,
        sigmas=sigmas,
        point_in_laser_mm=at_workpiece,
        facing=sight.facing,
        tool_sigma_mm=place.tool_sigma_mm if covariance is None else float(worst_sigma(covariance[3:, 3:])),
        tool_sigma_rad=place.tool_sigma_rad,
        known=covariance,
        priors=ScannerPriors() if covariance is None else None,  # the result's covariance has them in it
    )
    room = Room(sight, cell.limits, home, keep_off)
    # Until poses are corrected, what was found of their scatter has the arm's errors in it.
    corrected = bool(((result or {}).get("arm_model") or {}).get("applied"))
    own = sigmas_of(cell, result if corrected else None)
    with_arm = None if arm is None else replace(assumed, arm=arm, sigmas=own)
    agreeing = [one for one in taken if one.capture not in apart]
    agreed = place.by_captures and not apart
    return Situation(agreeing, assumed, room, agreed, apart, with_arm, workpiece)


def _calibration_poses(session: Session) -> tuple[RigidTransform, ...]:
    """Return where the flange stood in the calibration's captures of the still sphere."""
    found: list[RigidTransform] = []
    for capture in session.captures:
        if capture.step == "tcp" and not capture.excluded and capture.pose is not None:
            try:
                found.append(parse_pose(session.cell.pose_convention, capture.pose))
            except InputError:
                continue
    return tuple(found)


def _to_verify(
    cell: Cell, seen: Observations, sphere: SphereSize, result: Mapping[str, Any] | None
) -> _Place | None:
    """Return the tool that is verified, and where the sphere stands: by its own captures, else as it was."""
    tool = known_scanner(cell) or placed_scanner(result or {})
    if tool is None:
        return None
    if seen:
        one = seen[-1]
        place = one.sphere_center_in_laser_mm(sphere, one.side or 1)
        return _Place(tool, (one.ball_from_scanner @ tool).apply(place), 1.0, 0.005)
    return None if result is None else _Place(tool, _center(result), 1.0, 0.005)


def _center(result: Mapping[str, Any]) -> FloatArray:
    """Return where a result has the sphere, (3,), in what carries it."""
    return np.array(result[f"sphere_center_in_{carriers_found(result).ball}_mm"], dtype=float)


def sigmas_of(cell: Cell, result: Mapping[str, Any] | None = None) -> Sigmas:
    """Return how much robot and table scatter: as told, else as a result found it, else as arms usually do."""
    found = (result or {}).get("variance_components") or {}
    sigmas = SIGMAS
    if found.get("position_sigma_mm") is not None:
        sigmas = replace(
            sigmas,
            position_mm=found["position_sigma_mm"],
            orientation_rad=found["orientation_sigma_rad"],
            alike_position_mm=found.get("alike_position_sigma_mm", 0.0),
            alike_orientation_rad=found.get("alike_orientation_sigma_rad", 0.0),
            reach=(found.get("reach_mm") or REACH_MM) / REACH_MM,
            play_mm=found.get("play_sigma_mm") or sigmas.play_mm,
        )
    robot, table = cell.robot, cell.turntable
    if robot.position_sigma_mm is not None:
        sigmas = replace(sigmas, position_mm=robot.position_sigma_mm)
    if robot.orientation_sigma_rad is not None:
        sigmas = replace(sigmas, orientation_rad=robot.orientation_sigma_rad)
    if table.angle_sigma_deg is not None:
        sigmas = replace(sigmas, axes=(float(np.deg2rad(table.angle_sigma_deg)),))
    return sigmas


def _given(cell: Cell) -> GivenSigmas:
    """Return what is told of a pose's own errors."""
    return cell.robot.position_sigma_mm, cell.robot.orientation_sigma_rad


def _solved(results: ResultsData) -> Mapping[str, Any] | None:
    for stage in tool_stages():
        result = results.get(stage)
        if not result or (result.get("verdict") == "fail" and not result.get("undetermined")):
            continue  # an answer that does not explain its captures tells no pose
        placed = any(result.get(name) is not None for name in SCANNER_FRAMES)
        if placed and result.get(f"sphere_center_in_{carriers_found(result).ball}_mm"):
            return result
    return None


def several_balls_seen(cell: Cell, measured: Sequence[Measured]) -> bool:
    """Return whether most of the newest profiles show a second ball: which of them is which is not known."""
    if len(balls_in_sight(cell)) > 1:
        return True
    profiles = [m for m in measured if m.kind == "profile" and m.center_mm is not None][-_LOOKED_AT:]
    return 2 * sum(_shows_another(one, cell) for one in profiles) > len(profiles)


def _shows_another(measured: Measured, cell: Cell) -> bool:
    from calib_core.sphere.arc import fit_arc

    off = ~np.array(measured.preview_on_sphere, dtype=bool)
    try:
        fit_arc(np.array(measured.preview, dtype=float)[off], cell.sphere_diameter_mm, cell.scanner.z_axis)
    except MeasurementError:
        return False
    return True


def _used(seen: list[SphereObservation], result: Mapping[str, Any] | None) -> list[SphereObservation]:
    """Return captures without those that a result left out."""
    rows = (result or {}).get("residuals", [])
    left_out = {row["capture"] for row in rows if not row.get("used", True)}
    return [o for o in seen if o.capture not in left_out]


def _with_alike_points(sight: Sight, result: Mapping[str, Any] | None) -> Sight:
    """Return a sight that knows what a result found of points that err together: more than neighbours tell."""
    found = ((result or {}).get("variance_components") or {}).get("points_per_independent")
    return sight if found is None else replace(sight, points_per_independent=found)


def _middle(sight: Sight, result: Mapping[str, Any] | None) -> FloatArray:
    """Return where the scanner sees the workpiece: where it saw the sphere, else the middle of its field."""
    at = (result or {}).get("workpiece")
    return sight.middle_mm if at is None else np.array(at["point_in_laser_mm"], dtype=float)


def observations_of(
    cell: Cell, captures: Sequence[Capture], kept: Mapping[str, Measured], sight: Sight, sphere: SphereSize
) -> list[SphereObservation]:
    """Return what good captures, of which `kept` has what was seen, show of the sphere, without noise."""
    found: list[SphereObservation] = []
    for capture in captures:
        measured = kept.get(capture.id)
        if measured is None or measured.center_mm is None:
            continue
        try:
            pose = parse_pose(cell.pose_convention, capture.pose or [])
        except InputError:
            continue  # the guide asks for it to be mended
        center = np.array(measured.center_mm, dtype=float)
        if len(center) == 2:
            height = np.sqrt(max(sphere.radius_mm**2 - (measured.radius_mm or sphere.radius_mm) ** 2, 0.0))
            center = np.array([center[0], (capture.side or 1) * height, center[1]])
        own = replace(sight, point_sigma_mm=measured.point_sigma_mm or sight.point_sigma_mm)
        if measured.extent_deg and measured.kind == "profile":
            own = replace(own, arc_rad=float(np.clip(np.deg2rad(measured.extent_deg) / 2, 0.2, 1.5)))
        observation = own.observation(capture.id, pose, center, sphere.radius_mm)
        if len(measured.center_mm) == 2:
            observation = replace(observation, side=capture.side)
        found.append(observation)
    return found


def _home(cell: Cell, seen: Observations, sight: Sight) -> FloatArray | None:
    if seen:
        return seen[0].ball_from_scanner.rotation
    nominal = cell.nominal
    if nominal is None or nominal.base_from_tool0 is None:
        return None
    pose = RigidTransform.from_rounded(nominal.base_from_tool0, "base", "tool0")
    return sight.carriers.ball_from_scanner(pose).rotation


def _place(
    cell: Cell, seen: Observations, sphere: SphereSize, result: Mapping[str, Any] | None
) -> _Place | Contradiction | None:
    if result is not None:
        return _Place(scanner_frame(result), _center(result), by_captures=True)
    if ball_on_flange(cell):
        return _searched(seen, sphere)  # shifts and drawings tell of a scanner that sits near the flange
    return _searched(seen, sphere) or _by_shifts(seen, sphere) or _by_drawing(cell, seen)


def _searched(seen: Observations, sphere: SphereSize) -> _Place | Contradiction | None:
    """Return tool and sphere as the captures' own centres tell them, where these are enough."""
    from calib_core.chain.start import centers_of, find_start

    if len(seen) < _LEAST_SEARCHED:
        return None
    rotations = np.array([o.base_from_tool0.rotation for o in seen])
    if _turned(rotations) < 2:
        return None
    start = find_start(centers_of(seen, sphere))
    rival = start.rival_scatter_mm
    if start.scatter_mm > _GOOD_SCATTER_MM:
        return Contradiction()
    if rival is not None and rival < 2 * start.scatter_mm:
        return None
    agree = start.misfit_mm <= GROSS * max(start.scatter_mm, SIGMAS.position_mm)
    if not agree.all() and _turned(rotations[agree]) < _LEAST_AGREEING:
        return None  # some tool fits so few whatever they are: which of them are wrong is not known yet
    tool = RigidTransform.of(start.rotation, start.translation, seen[0].carriers.scanner, "laser")
    return _Place(tool, start.center, by_captures=True)


def _turned(rotations: FloatArray) -> int:
    """Return how many of some orientations differ from the first of them."""
    turns = np.linalg.norm(vector_from_rotation(rotations[0].T @ rotations), axis=1)
    return int(np.sum(turns > _LEAST_TURN_RAD))


def _by_shifts(seen: Observations, sphere: SphereSize) -> _Place | None:
    """Return what shifts tell: the scanner's rotation; where it sits on the flange only as far as turns tell."""
    from calib_core.chain.two_step import EQUAL_ORIENTATION_RAD
    from calib_core.guidance.sphere_guess import SeenCenter, probable_place

    if not seen:
        return None
    first = seen[0].base_from_tool0.rotation
    centers = [
        SeenCenter(
            o.base_from_tool0,
            o.sphere_center_in_laser_mm(sphere, 1),
            o.circle_radius_mm is not None and o.side is None,
        )
        for o in seen
    ]
    alike = [float(np.linalg.norm(first - o.base_from_tool0.rotation)) < EQUAL_ORIENTATION_RAD for o in seen]
    shifted = [c for c, same in zip(centers, alike, strict=True) if same]
    place = probable_place(shifted, [c for c, same in zip(centers, alike, strict=True) if not same])
    return None if place is None else _Place(place.mount_from_laser, place.center_in_base_mm, 150.0, 0.05)


def _by_drawing(cell: Cell, seen: Observations) -> _Place | None:
    """Return what a drawing tells, with the sphere where the captures so far saw it by that."""
    nominal = cell.nominal
    tool = None if nominal is None else placed_scanner(nominal.model_dump())
    if nominal is None or tool is None:
        return None
    center = nominal.sphere_center_in_base_mm
    if seen:
        center = np.mean([(o.base_from_tool0 @ tool).apply(o.center_in_laser_mm) for o in seen], axis=0)
    if center is None:
        return None
    sigma_deg = nominal.tool_sigma_deg or _NOMINAL_DEG
    return _Place(tool, np.array(center), nominal.tool_sigma_mm or _NOMINAL_MM, float(np.deg2rad(sigma_deg)))
