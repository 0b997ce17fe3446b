"""What an arm does wrong, in few named numbers: zeros of joints, links, coupling, sag; how they move its flange.

Complete and minimal, as Denavit and Hartenberg count: from each axis to the next a turn about the first one (the
joint's zero), a shift along it, a shift along the common normal and a turn about that; where two axes are parallel
a turn about the third direction stands for the shift along them (Hayati, 1983).  What base and tool take up (the
first joint's zero and place, the last one's) is none of the arm's.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from calib_core.arms.kinematics import joint_lines
from calib_core.errors import InputError
from calib_core.frames import FloatArray, rotation_from_vector, skew
from calib_core.records import ArmTable

Member = Literal["offsets", "links", "coupling", "sag"]
MEMBERS: tuple[Member, ...] = ("offsets", "links", "coupling", "sag")
"""What a model may have, in the order in which real arms have it."""

_ZERO: Final = re.compile(r"joint_(\d+)_zero_deg")
_PARALLEL = 0.05  # rad between two axes
_DOWN = np.array([0.0, 0.0, -1.0])

# Reach of the arm up to so many mm; zeros of joints in deg, lengths in mm, axes in deg, coupling in deg/deg, sag
# stretched out in deg.  Trackers publish errors of the flange: sizes are such that they add up to those, and each
# member has a scale of its own, which the captures tell (docs/arm.md).
_CLASSES = (
    (500.0, (0.12, 0.25, 0.035, 5e-4, 0.02)),
    (1000.0, (0.08, 0.3, 0.03, 3e-4, 0.025)),
    (1600.0, (0.06, 0.4, 0.025, 2e-4, 0.03)),
    (np.inf, (0.04, 0.5, 0.02, 2e-4, 0.03)),
)


@dataclass(frozen=True)
class ArmTerm:
    """One number of an arm's error: its name ends in its unit, `sigma` is what is believed of it.

    It moves all that stands behind `joint`, counted from 0.
    """

    name: str
    member: Member
    sigma: float
    joint: int


def arm_terms(arm: ArmTable) -> tuple[ArmTerm, ...]:
    """Return the terms of an arm's error, in order."""
    return tuple(term for term, _ in _terms(arm, [0.0] * len(arm.joints), [0.0] * len(arm.joints)))


def places_of_zeros(names: Sequence[str]) -> dict[int, int]:
    """Return which of some terms is the zero of each joint, by the joint's number."""
    return {int(named[1]): place for place, name in enumerate(names) if (named := _ZERO.fullmatch(name))}


def arm_moves(arm: ArmTable, joints: Sequence[Sequence[float | None]]) -> FloatArray:
    """Return how the flange moves in base with each term, (K, 6, p): mm and rad (about base's axes) a unit.

    Parameters
    ----------
    arm : ArmTable
    joints : K sequences
        Of each joint's reading, deg or mm.

    Raises
    ------
    InputError
        If a joint has no reading.
    """
    return np.array([[move for _, move in _terms(arm, row, row)] for row in joints]).transpose(0, 2, 1)


def corrected_pose(
    rotation: FloatArray, translation: FloatArray, moves: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where the flange truly is by the values (p,) of an arm's terms: rotation (3, 3), translation (3,)."""
    moved = moves @ values
    return rotation_from_vector(moved[3:]) @ rotation, translation + moved[:3]


def _terms(
    arm: ArmTable, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None]
) -> list[tuple[ArmTerm, FloatArray]]:
    points, axes, flange = joint_lines(arm, joints_deg, joints_mm)
    reach = reach_of(arm)
    zero_deg, length_mm, axis_deg, coupling, sag_deg = next(own for most, own in _CLASSES if reach <= most)
    count, turns = len(arm.joints), [joint.kind == "revolute" for joint in arm.joints]
    readings = [float(value or 0.0) for value in joints_deg]
    found: list[tuple[ArmTerm, FloatArray]] = []

    def turn(name: str, member: Member, sigma: float, axis: FloatArray, at: FloatArray, by: float = 1.0) -> None:
        move = np.deg2rad(by) * np.concatenate([skew(axis) @ (flange - at), axis])
        found.append((ArmTerm(name, member, sigma, n), move))

    def shift(name: str, axis: FloatArray) -> None:
        found.append((ArmTerm(name, "links", length_mm, n), np.concatenate([axis, np.zeros(3)])))

    for n in range(1, count - 1):
        if turns[n]:
            turn(f"joint_{n + 1}_zero_deg", "offsets", zero_deg, axes[n], points[n])
    for n in range(count - 1):
        parallel, normal, foot = _to_next(points, axes, n)
        shift(f"link_{n + 1}_length_mm", normal)
        turn(f"link_{n + 1}_twist_deg", "links", axis_deg, normal, foot)
        if parallel:
            turn(
                f"link_{n + 1}_tilt_deg",
                "links",
                axis_deg,
                np.asarray(np.cross(axes[n], normal), dtype=float),
                foot,
            )
        elif n:
            shift(f"link_{n + 1}_offset_mm", axes[n])
    if count == 6 and all(turns):
        for n in (2, 4, 5):
            name = f"joint_{n + 1}_by_joint_{n}_deg_per_deg"
            turn(name, "coupling", coupling, axes[n], points[n], readings[n - 1])
        for n in (1, 2):
            load = float(axes[n] @ (skew(flange - points[n]) @ _DOWN)) / reach
            turn(f"joint_{n + 1}_sag_deg", "sag", sag_deg, axes[n], points[n], load)
    return found


def reach_of(arm: ArmTable) -> float:
    """Return about how far an arm reaches from its second axis, mm."""
    told = sum(float(np.hypot(joint.a_mm, joint.d_mm)) for joint in arm.joints[1:])
    placed = [joint.previous_from_joint for joint in arm.joints[1:]]
    return told + sum(float(np.linalg.norm(np.array(rows)[:3, 3])) for rows in placed if rows is not None)


def _to_next(points: FloatArray, axes: FloatArray, n: int) -> tuple[bool, FloatArray, FloatArray]:
    """Return whether an axis is parallel to the next, the common normal (3,), and its foot on the next (3,)."""
    one, other = axes[n], axes[n + 1]
    across, between = skew(one) @ other, points[n + 1] - points[n]
    size = float(np.linalg.norm(across))
    if size > _PARALLEL:
        # Where the next axis is nearest to this one.
        along = float((skew(between) @ one) @ across) / size**2
        return False, across / size, points[n + 1] + along * other
    apart = between - float(between @ one) * one
    length = float(np.linalg.norm(apart))
    if length > 1.0:
        return True, apart / length, points[n + 1]
    beside = points[n + 2] - points[n + 1] if n + 2 < len(points) else np.eye(3)[int(np.argmin(np.abs(one)))]
    apart = np.cross(one, beside)
    length = float(np.linalg.norm(apart))
    if length < 1e-6:
        apart = np.cross(one, np.eye(3)[int(np.argmin(np.abs(one)))])
    return True, apart / float(np.linalg.norm(apart)), points[n + 1]


def joint_readings(arm: ArmTable, deg: Sequence[float | None], mm: Sequence[float | None]) -> list[float | None]:
    """Return each joint's reading in order, deg or mm; raises InputError where one is missing."""
    every = [mm if joint.kind == "prismatic" else deg for joint in arm.joints]
    found = [row[n] if n < len(row) else None for n, row in enumerate(every)]
    if None in found:
        need = "a reading of each joint of the arm"
        raise InputError(need, "none of joint {place}", "Add it.", place=found.index(None) + 1)
    return found
