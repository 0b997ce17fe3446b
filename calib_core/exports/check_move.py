"""A check move: the light plane goes to the sphere's centre from three sides, by the tool that was entered.

A point of the light plane at working distance, where the scanner saw the sphere on average, goes to the sphere's
centre; the scanner's own origin stays as far as it was while the sphere was captured, so its housing keeps that
distance.  Orientations are those of captures, which the robot has reached before.  Every target is approached in
a straight line from well outside, slowly, and only after the operator has started it.
"""

import json
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from pydantic import Field

from calib_core.errors import ConflictError, InputError
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export, Settings
from calib_core.exports.workpiece import seen_in_laser_mm
from calib_core.exports.writing import provenance, several_scanners, tool_pose
from calib_core.frames import FloatArray, RigidTransform, vector_from_rotation
from calib_core.messages import message
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.steps import steps_that_show

SIDES = 3
_MOST_ORIENTATIONS = 60
_LEAST_FREE_MM = 20.0


class CheckSettings(Settings):
    """How far outside an approach begins, how fast the robot goes; of which of several scanners."""

    of_scanner: str | None = None

    approach_mm: float = Field(default=150.0, ge=50.0, le=1000.0)
    speed_mm_s: float = Field(default=50.0, gt=0.0, le=250.0)


@dataclass(frozen=True, eq=False)
class CheckTarget:
    """One side: where the scanner's frame goes, and where its approach begins; transforms in the base."""

    capture: str
    base_from_laser: RigidTransform
    approach: RigidTransform


@dataclass(frozen=True, eq=False)
class CheckMove:
    """Targets from three sides, and what the scanner should then show.

    Parameters
    ----------
    targets : tuple of CheckTarget
    point_in_laser_mm : (3,)
        The point of the light plane that is brought to the sphere's centre.
    sphere_center_in_base_mm : (3,)
    radius_mm : float or None
        Of the circle in the profile: the sphere's own.
    tolerance_mm : float
        Within which the circle's centre should lie at the point: three standard deviations.
    """

    targets: tuple[CheckTarget, ...]
    point_in_laser_mm: FloatArray
    sphere_center_in_base_mm: FloatArray
    radius_mm: float | None
    tolerance_mm: float

    def expected(self) -> str:
        """Return what the scanner should show at each target, as a sentence in ASCII."""
        x, _, z = self.point_in_laser_mm
        radius = "" if self.radius_mm is None else f" of radius {self.radius_mm:.3f} mm (the sphere's own)"
        return f"a circle{radius} about x {x:.2f}, z {z:.2f} mm, within {self.tolerance_mm:.2f} mm"


def check_move(answer: Answer, settings: CheckSettings) -> CheckMove:
    """Return the check move of an answer of one scanner, as `checked_tool` gives it.

    Raises
    ------
    ConflictError
        If the answer has faults of its own, whatever is allowed elsewhere: the robot would move by it.
    InputError
        If the captures do not tell where the sphere stood.
    """
    answer.require_usable()
    _ = answer.tool  # of a scanner that stands still there is no tool to check
    if "undetermined" in (result := answer.results[answer.stage]) and result["undetermined"]:
        to_do = "Capture what the guide asks."
        raise ConflictError("a tool that is determined", "one that is not, in parts", to_do)
    seen = seen_in_laser_mm(answer.session, result)
    if seen is None or "sphere_center_in_base_mm" not in result:
        to_do = message("Capture the sphere standing still, with the robot's poses.")
        raise InputError("captures of the sphere with poses", "none", to_do, answer.stage)
    center = np.array(result["sphere_center_in_base_mm"], dtype=float)
    point = np.array([seen[0], 0.0, seen[2]])  # in the light plane
    diameter = answer.session.cell.sphere_diameter_mm
    free_mm = float(np.linalg.norm(point)) - (diameter or 0.0) / 2
    if free_mm < _LEAST_FREE_MM:
        got = message("one {free_mm:.0f} mm from the sphere's surface", free_mm=free_mm)
        to_do = message("Look at the captures: the scanner would touch the sphere.")
        need = "a scanner's origin {least_free_mm:g} mm off the sphere"
        raise InputError(need, got, to_do, answer.stage, least_free_mm=_LEAST_FREE_MM)
    away = -point / np.linalg.norm(point)  # from the sphere to the scanner's origin, in L
    targets = tuple(
        CheckTarget(name, target, _placed(rotation, center + rotation @ away * settings.approach_mm, point))
        for name, rotation in _three_sides(answer)
        if (target := _placed(rotation, center, point))
    )
    spread = _spread_mm(answer, point, float(result.get("center_scatter_rms_mm") or 0.0))
    return CheckMove(targets, point, center, diameter / 2 if diameter else None, spread)


def checked_tool(answer: Answer, settings: CheckSettings) -> Answer:
    """Return the answer of the scanner that is checked: the one that is named, else the only one on the flange."""
    held = [name for name, (mount, _) in answer.scanners().items() if mount.into == "tool0"]
    if settings.of_scanner is None and len(held) > 1:
        raise several_scanners()
    return answer.of_scanner(settings.of_scanner or next(iter(held), None))


def _placed(rotation: FloatArray, center_mm: FloatArray, point_mm: FloatArray) -> RigidTransform:
    return RigidTransform.of(rotation, center_mm - rotation @ point_mm, "base", "laser")


def _three_sides(answer: Answer) -> list[tuple[str, FloatArray]]:
    """Return three captures and the scanner's orientations in them, as far from each other as there are."""
    used = {row["capture"] for row in answer.results[answer.stage]["residuals"] if row["used"]}
    rotations: dict[str, FloatArray] = {}
    for capture in answer.session.captures:
        if capture.id in used and capture.step in steps_that_show("sphere") and capture.pose is not None:
            pose = parse_pose(answer.session.cell.pose_convention, capture.pose)
            rotations[capture.id] = pose.rotation @ answer.tool.rotation
    names = list(rotations)[:_MOST_ORIENTATIONS]
    if len(names) < SIDES:
        to_do = message("Capture the sphere from three sides.")
        raise InputError("{sides} captures with poses", f"{len(names)}", to_do, answer.stage, sides=SIDES)
    apart = {
        (a, b): float(np.linalg.norm(vector_from_rotation(rotations[a].T @ rotations[b])))
        for a, b in combinations(names, 2)
    }
    best = max(combinations(names, SIDES), key=lambda three: min(apart[pair] for pair in combinations(three, 2)))
    return [(name, rotations[name]) for name in best]


def _spread_mm(answer: Answer, point_mm: FloatArray, scatter_mm: float) -> float:
    """Return three standard deviations of where the circle lies: the tool's, and one pose's scatter."""
    from calib_core.exports.workpiece import point_jacobian

    jacobian = point_jacobian(answer.tool, point_mm)
    tool = float(np.linalg.eigvalsh(jacobian @ answer.tool_covariance @ jacobian.T)[-1])
    return 3 * float(np.sqrt(max(tool, 0.0) + scatter_mm**2))


def _write(answer: Answer, settings: CheckSettings) -> str:
    """Return the targets in the session's own convention, for the scanner's frame and for the flange."""
    answer = checked_tool(answer, settings)
    move = check_move(answer, settings)
    convention = answer.session.cell.pose_convention
    tool = answer.tool

    def both(base_from_laser: RigidTransform) -> dict[str, list[float]]:
        flange = base_from_laser @ tool.inverse()
        return {"scanner": numbers(base_from_laser), "flange": numbers(flange)}

    def numbers(pose: RigidTransform) -> list[float]:
        return to_pose(convention, RigidTransform(pose.matrix, "base", "tool0"))

    known = CONVENTIONS[convention]
    data = {
        "format": "scancell-check-move/1",
        "about": provenance(answer),
        "convention": convention,
        "numbers": known.numbers,
        "units": known.units,
        "tool": tool_pose(answer, convention),
        "speed_mm_s": settings.speed_mm_s,
        "expected": move.expected(),
        "point_in_laser_mm": move.point_in_laser_mm.tolist(),
        "sphere_center_in_base_mm": move.sphere_center_in_base_mm.tolist(),
        "targets": [
            {"capture": t.capture, "approach": both(t.approach), "target": both(t.base_from_laser)}
            for t in move.targets
        ],
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


EXPORT = Export(
    "check-move", "Check move: the light plane to the sphere from three sides", "application/json", ".json",
    _write, CheckSettings, proof=None,
)  # fmt: skip
