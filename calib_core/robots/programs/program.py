"""What a controller's program is made of: stops with approach points outside, a slow speed, whom to ask."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.poses.numbers import to_pose
from calib_core.proof import Proof

LONGEST_SAID = 78
"""Characters of one answer; strings of some controllers hold 80."""


@dataclass(frozen=True, eq=False)
class Stop:
    """A pose of a capture and the point outside from which it is gone to, in the numbers of the brand."""

    name: str
    pose: tuple[float, ...]
    approach: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """What a program shall do.

    Parameters
    ----------
    stops : tuple of Stop
    host, port : str, int
        Where this workbench listens for robot programs.
    token : str
        With the role `capture`; a placeholder that the operator replaces where it is not given.
    speed_mm_s : float
        At most 250, the speed of manual mode.
    fields : str
        What is sent beside each pose: "step=turntable mount=low".
    """

    stops: tuple[Stop, ...]
    host: str
    port: int
    token: str
    speed_mm_s: float
    fields: str = ""


@dataclass(frozen=True)
class Program:
    """A dialect: how a plan is written for a controller.

    Parameters
    ----------
    name : str
        As the REST path names it.
    title : str
    convention : str
        Of its poses.
    write : callable
        (plan) to the program's files by name.
    needs : str
        Which option the controller must have.
    proof : Proof
        What proved that a controller runs it.
    """

    name: str
    title: str
    convention: str
    write: Callable[[Plan], Mapping[str, str]]
    needs: str = ""
    proof: Proof = "manual only"


def plan_of(
    program: Program,
    poses: Sequence[tuple[str, RigidTransform]],
    host: str,
    port: int,
    token: str,
    speed_mm_s: float = 50.0,
    approach_mm: float = 150.0,
    sphere_center_in_base_mm: Sequence[float] | None = None,
    fields: str = "",
) -> Plan:
    """Return the plan of a set of flange poses.

    Each pose is gone to in a straight line from `approach_mm` outside and left by the same way: away from the
    sphere's centre where that is known, else back along the flange's z.

    Raises
    ------
    InputError
        If there are no poses, or the speed or the approach are beyond what is safe.
    """
    if not poses:
        raise InputError("poses to go to", "none", "Give a planned set, or captures with poses.", "poses")
    if not 0 < speed_mm_s <= 250.0:
        raise InputError("a speed up to 250 mm/s", f"{speed_mm_s:g}", "Go slowly.", "speed_mm_s")
    if not 20.0 <= approach_mm <= 1000.0:
        raise InputError("an approach of 20 to 1000 mm", f"{approach_mm:g}", "Correct it.", "approach_mm")

    def numbers(pose: RigidTransform) -> tuple[float, ...]:
        return tuple(to_pose(program.convention, pose))

    stops = tuple(
        Stop(name, numbers(pose), numbers(_outside(pose, approach_mm, sphere_center_in_base_mm)))
        for name, pose in poses
    )
    return Plan(stops, host, port, token, speed_mm_s, fields)


def _outside(pose: RigidTransform, by_mm: float, center_mm: Sequence[float] | None) -> RigidTransform:
    away: FloatArray = -pose.rotation[:, 2]
    if center_mm is not None:
        from_center = pose.translation_mm - np.asarray(center_mm, dtype=float)
        length = float(np.linalg.norm(from_center))
        away = from_center / length if length > 1.0 else away
    return RigidTransform.of(pose.rotation, pose.translation_mm + by_mm * away, "base", "tool0")


def number(value: float, digits: int) -> str:
    """Return a number without an exponent and without a negative zero."""
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


HEAD = (
    "SCANCELL CAPTURES: run it in manual mode at reduced speed first",
    "the operator starts every way; the sphere must stand where it stood",
    "poses are the flange's in the base: no tool, no frame",
)
"""What stands at the head of every program."""
