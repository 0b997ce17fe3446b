"""One pose: a convention's numbers to base_from_tool0, and back."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector
from calib_core.messages import plural
from calib_core.poses.convention import Convention
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.rotations import (
    angles_from_rotation,
    quaternion_from_rotation,
    rotation_from_angles,
    rotation_from_quaternion,
)

_UNIT_TOLERANCE = 1e-2
_FARTHEST_MM = 1e7  # no arm stands so far from its base: such numbers come of damaged files


def convention_named(name: str) -> Convention:
    """Return a convention by its name.

    Raises
    ------
    InputError
        That lists the names, if there is none of this name.
    """
    if name not in CONVENTIONS:
        need = "one of the pose conventions {conventions}"
        raise InputError(need, repr(name), "Name the controller's convention.", conventions=", ".join(CONVENTIONS))
    return CONVENTIONS[name]


def parse_pose(convention: str, numbers: Sequence[float], where: str = "") -> RigidTransform:
    """Return base_from_tool0, in millimetres, from a controller's numbers.

    Parameters
    ----------
    convention : str
        A name in `CONVENTIONS`.
    numbers : sequence of float
        In the order and units of the convention.
    where : str, optional
        The capture or file, for the error.

    Raises
    ------
    InputError
        If the convention is unknown, the count is wrong, a number is not finite, the position is out of
        all reach, or the orientation is not one.
    """
    known = convention_named(convention)
    if len(numbers) != known.count:
        raise InputError(
            "a pose of {count} numbers ({numbers})",
            plural("{got} number", "{got} numbers", by="got", got=len(numbers)),
            "Give all of them, or choose another convention than '{convention}'.",
            where,
            count=known.count,
            numbers=known.numbers,
            convention=convention,
        )
    values = np.array([float(v) for v in numbers])
    if not np.isfinite(values).all():
        bad = known.numbers.split()[int(np.argmin(np.isfinite(values)))]
        need = "a pose of finite numbers ({numbers})"
        to_do = "Read the pose from the controller again."
        raise InputError(need, f"{bad} = {values[~np.isfinite(values)][0]}", to_do, where, numbers=known.numbers)
    try:
        return _read(convention, values.tobytes())
    except InputError as error:
        raise (error.at(where) if where else error) from None


@lru_cache(maxsize=2000)
def _read(convention: str, numbers: bytes) -> RigidTransform:
    """Return what `parse_pose` does of doubles; kept, for each guide and solve asks for all poses of a session."""
    pose = _pose(CONVENTIONS[convention], np.frombuffer(numbers))
    _require_reachable(pose)
    return pose


def to_pose(convention: str, base_from_tool0: RigidTransform) -> list[float]:
    """Return a pose as a controller's numbers: the inverse of `parse_pose`.

    Angles are in [−180°, 180°], quaternions have a scalar part that is not negative.

    Raises
    ------
    InputError
        If the convention is unknown.
    """
    known = convention_named(convention)
    if known.form == "matrix":
        return base_from_tool0.matrix.ravel().tolist()
    position = base_from_tool0.translation_mm / known.mm_per_unit
    return [*position.tolist(), *_orientation(known, base_from_tool0).tolist()]


def _pose(known: Convention, values: FloatArray) -> RigidTransform:
    if known.form == "matrix":
        return RigidTransform.from_rounded(values.reshape(4, 4), "base", "tool0")
    return RigidTransform.of(_rotation(known, values[3:]), values[:3] * known.mm_per_unit, "base", "tool0")


def _require_reachable(base_from_tool0: RigidTransform) -> None:
    farthest_mm = float(np.abs(base_from_tool0.translation_mm).max())
    if farthest_mm > _FARTHEST_MM:
        raise InputError(
            "a flange within {farthest_mm:g} km of the base",
            "one {farthest_mm_other:.3g} km away",
            "Read the pose from the controller again.",
            farthest_mm=_FARTHEST_MM / 1000000.0,
            farthest_mm_other=farthest_mm / 1000000.0,
        )


def _rotation(known: Convention, values: FloatArray) -> FloatArray:
    if known.form == "rotation-vector":
        return rotation_from_vector(values)
    if known.form == "quaternion":
        length = float(np.linalg.norm(values))
        if abs(length - 1) > _UNIT_TOLERANCE:
            raise InputError(
                "a unit quaternion ({numbers})",
                "one of length {length:.4g}",
                "Give all its digits, and check the order of the numbers and the convention.",
                numbers=" ".join(known.numbers.split()[3:]),
                length=length,
            )
        return rotation_from_quaternion(values if known.listed == "xyzw" else np.roll(values, -1))
    angles = np.radians(values)
    return rotation_from_angles(known.form, angles if known.listed == "forward" else angles[::-1])


def _orientation(known: Convention, base_from_tool0: RigidTransform) -> FloatArray:
    if known.form == "rotation-vector":
        return base_from_tool0.rotation_vector_rad
    if known.form == "quaternion":
        q = quaternion_from_rotation(base_from_tool0.rotation)
        return q if known.listed == "xyzw" else np.roll(q, 1)
    angles = angles_from_rotation(known.form, base_from_tool0.rotation) * (180 / math.pi)
    return angles if known.listed == "forward" else angles[::-1]
