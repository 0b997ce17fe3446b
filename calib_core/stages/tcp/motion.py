"""What the captures' robot poses do already for the TCP, and which pose would help most next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.chain.two_step import EQUAL_ORIENTATION_RAD, pure_translations
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector, vector_from_rotation

LEAST_SHIFTS, WANTED_SHIFTS = 2, 3
LEAST_TURNS, WANTED_TURNS, GOOD_TURNS = 3, 6, 10
_LEAST_SHIFT_MM = 10.0
_LEAST_TURN_RAD = np.deg2rad(5.0)
_DIFFERENT = np.sin(np.deg2rad(20.0))  # directions nearer to each other than this count as parallel

_SHIFTS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], dtype=float)
_TURNS_RAD = np.deg2rad(
    [
        [20, 0, 0], [0, 20, 0], [0, 0, 25], [-20, 0, 0], [0, -20, 0], [0, 0, -25],
        [15, 15, 10], [-15, 15, -10], [15, -15, -10], [-15, -15, 10],
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Motion:
    """The motions of a set of poses.

    Parameters
    ----------
    reference : int
        The capture that shifts and turns are counted from: the first of those that share their orientation.
    shifts_mm : (S, 3)
        Pure translations of at least 10 mm, in tool0 of the reference.
    turns_rad : (T, 3)
        Changes of orientation of at least 5°, rotation vectors in tool0 of the reference; orientations that are
        alike count once.
    """

    reference: int
    shifts_mm: FloatArray
    turns_rad: FloatArray

    @property
    def shifts_differ(self) -> bool:
        """Whether two shifts at least are not parallel."""
        return _rank_two(self.shifts_mm)

    @property
    def turns_differ(self) -> bool:
        """Whether two turns at least are about axes that are not parallel."""
        return _rank_two(self.turns_rad)


def motion_of(poses: Sequence[RigidTransform]) -> Motion:
    """Return the shifts and turns among robot poses (at least one)."""
    rotations = np.array([p.rotation for p in poses])
    groups = pure_translations(rotations)
    largest = max(groups, key=len, default=(0,))
    reference = largest[0]
    home = poses[reference]
    shifts = np.array([home.rotation.T @ (poses[k].translation_mm - home.translation_mm) for k in largest[1:]])
    shifts = shifts.reshape(-1, 3)
    turns = vector_from_rotation(home.rotation.T @ rotations)
    kept: list[int] = []
    for k in np.flatnonzero(np.linalg.norm(turns, axis=1) >= _LEAST_TURN_RAD):
        if not kept or _angles_rad(rotations[k], rotations[kept]).min() > EQUAL_ORIENTATION_RAD:
            kept.append(int(k))
    long_enough = np.linalg.norm(shifts, axis=1) >= _LEAST_SHIFT_MM
    return Motion(reference, shifts[long_enough], turns[kept])


def next_shift(motion: Motion, home: RigidTransform, length_mm: float) -> RigidTransform:
    """Return the pose, shifted from `home` along a flange axis, that differs most from the shifts taken."""
    taken = _units(motion.shifts_mm)
    likeness = np.abs(_SHIFTS @ taken.T).max(axis=1, initial=0.0)
    shift = _SHIFTS[int(np.argmin(likeness))] * length_mm
    return home.perturbed(np.concatenate([np.zeros(3), home.rotation @ shift]))


def next_turn(motion: Motion, home: RigidTransform, sphere_center_in_base: FloatArray | None) -> RigidTransform:
    """Return the pose whose orientation is furthest from those taken already, of a fixed plan of ten.

    Parameters
    ----------
    motion : Motion
    home : RigidTransform
        The pose of the reference capture.
    sphere_center_in_base : (3,) or None
        Where the sphere is, mm: the flange then turns about it, so that the scanner goes on seeing it.  Where
        it is not known yet the flange turns in its place.
    """
    taken = [np.zeros(3), *motion.turns_rad]
    gains = [nearest_turn_rad(turn, taken) for turn in _TURNS_RAD]
    # Among equals the first of the plan.
    rotation = home.rotation @ rotation_from_vector(_TURNS_RAD[int(np.argmax(np.round(gains, 6)))])
    if sphere_center_in_base is None:
        return RigidTransform.of(rotation, home.translation_mm, "base", "tool0")
    center_in_tool0 = home.inverse().apply(sphere_center_in_base)
    return RigidTransform.of(rotation, sphere_center_in_base - rotation @ center_in_tool0, "base", "tool0")


def turn_between_deg(a: RigidTransform, b: RigidTransform) -> tuple[float, str]:
    """Return the angle in degrees from a to b and the flange axis it is mostly about, as "x", "y" or "z"."""
    turn = vector_from_rotation(a.rotation.T @ b.rotation)
    return float(np.rad2deg(np.linalg.norm(turn))), "xyz"[int(np.argmax(np.abs(turn)))]


def nearest_turn_rad(turn: FloatArray, others: Sequence[FloatArray]) -> float:
    """Return the angle to the nearest of other orientations, each as a rotation vector."""
    from scipy.spatial.transform import Rotation

    if not others:
        return np.pi
    between = Rotation.from_rotvec(turn).inv() * Rotation.from_rotvec(np.array(others))
    return float(between.magnitude().min())


def _angles_rad(rotation: FloatArray, others: FloatArray) -> FloatArray:
    """Return the angles (N,) from a rotation (3, 3) to others (N, 3, 3), from the length of the chord between."""
    chords = np.linalg.norm((others - rotation).reshape(-1, 9), axis=1)
    return 2 * np.arcsin(np.minimum(chords / np.sqrt(8), 1.0))


def _units(vectors: FloatArray) -> FloatArray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _rank_two(vectors: FloatArray) -> bool:
    """Whether some two of the vectors (N, 3) are not parallel."""
    if len(vectors) < 2:
        return False
    units = _units(vectors)
    sines = np.linalg.norm(np.cross(units[:, None], units[None]), axis=-1)
    return float(sines.max()) > _DIFFERENT
