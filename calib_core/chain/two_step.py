"""The paper's two steps: pure translations give the TCP's rotation, changes of orientation its translation.

Li et al., "Calibration of a multiple axes 3-D laser scanning system …", Optik (2010), section 2.2.  Each capture
enters as one sphere centre X_k in L, with the robot's R_0k, T_0k.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, nearest_rotation, vector_from_rotation
from calib_core.messages import message

# Two orientations count as equal within this angle: robots repeat an orientation far better, people never mean so
# small a change.  What is left of it is not neglected below.
EQUAL_ORIENTATION_RAD = np.deg2rad(0.5)
_PARALLEL = np.sin(np.deg2rad(5.0))
_LEAST_SHIFT_MM = 2.0
_MOST_PAIRS = 30  # that begin at one capture: all pairs of a group would grow with its square


@dataclass(frozen=True, eq=False)
class TwoStepAnswer:
    """The paper's answer, or why there is none.

    Attributes
    ----------
    rotation, translation, center : (3, 3), (3,), (3,) or None
        mount_from_laser and the sphere's centre in base.
    groups : tuple of tuples of int
        The captures that are pure translations of each other.
    reason : str or None
        What is missing, where there is no answer.
    """

    rotation: FloatArray | None
    translation: FloatArray | None
    center: FloatArray | None
    groups: tuple[tuple[int, ...], ...]
    reason: str | None


def pure_translations(rotations: FloatArray) -> tuple[tuple[int, ...], ...]:
    """Return the groups of captures that share their orientation, found from the robot's rotations (K, 3, 3)."""
    flat, left = rotations.reshape(-1, 9), np.arange(len(rotations))
    groups: list[tuple[int, ...]] = []
    while len(left):
        cosines = (flat[left] @ flat[left[0]] - 1) / 2
        alike = cosines > np.cos(EQUAL_ORIENTATION_RAD)
        alike[0] = True
        if alike.sum() > 1:
            groups.append(tuple(left[alike].tolist()))
        left = left[~alike]
    return tuple(groups)


def without_capture(groups: Sequence[Sequence[int]], left_out: int) -> tuple[tuple[int, ...], ...]:
    """Return the groups of the captures that remain without one, numbered as these."""
    rest = (tuple(k - (k > left_out) for k in group if k != left_out) for group in groups)
    return tuple(group for group in rest if len(group) > 1)


def two_step(
    rotations: FloatArray,
    translations: FloatArray,
    centers_in_laser: FloatArray,
    groups: tuple[tuple[int, ...], ...] | None = None,
) -> TwoStepAnswer:
    """Return the paper's answer.

    Parameters
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0, mm.
    centers_in_laser : (K, 3)
        The sphere's centre in L, sides decided, mm.
    groups : optional
        `pure_translations`, where they are known.
    """
    groups = pure_translations(rotations) if groups is None else groups
    missing = _missing_translations(rotations, translations, _pairs(groups)) or _missing_orientations(rotations)
    if missing:
        return TwoStepAnswer(None, None, None, groups, missing)
    rotation, translation, center = both_steps(rotations, translations, centers_in_laser, groups)
    return TwoStepAnswer(rotation, translation, center, groups, None)


def both_steps(
    rotations: FloatArray, translations: FloatArray, centers: FloatArray, groups: Sequence[Sequence[int]]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return R_s, T_s and the sphere's centre, given groups of pure translations that suffice."""
    rotation = _rotation_step(rotations, translations, centers, _pairs(groups))
    return rotation, *_translation_step(rotations, translations, centers, rotation)


def _pairs(groups: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """Return pairs of pure translations: of a large group some for each capture, near and far ones alike."""
    return [
        (i, group[n + stride])
        for group in groups
        for stride in np.unique(np.linspace(1, len(group) - 1, min(len(group) - 1, _MOST_PAIRS)).astype(int))
        for n, i in enumerate(group[: len(group) - stride])
    ]


def _rotation_step(
    rotations: FloatArray, translations: FloatArray, centers: FloatArray, pairs: Sequence[tuple[int, int]]
) -> FloatArray:
    """Return R_s from R_s (X_i − X_j) = R_0iᵀ (T_0j − T_0i) by orthogonal Procrustes.

    R_0i and R_0j, nearly equal, enter by their mean rotation; what their difference does to the far arm
    R_0 T_s cancels to first order over the pairs and is left to the joint likelihood.
    """
    i, j = np.array(pairs).T
    mean = nearest_rotation(rotations[i] + rotations[j])
    seen = centers[i] - centers[j]
    moved = np.einsum("kji,kj->ki", mean, translations[j] - translations[i])
    return nearest_rotation(moved.T @ seen)


def _translation_step(
    rotations: FloatArray, translations: FloatArray, centers: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return T_s and the sphere's centre from R_0k T_s − c = −T_0k − R_0k R_s X_k by least squares.

    With the centre as an unknown this is the paper's system over all pairs, each capture counted once.
    """
    rows = np.concatenate([rotations, np.broadcast_to(-np.eye(3), rotations.shape)], axis=2)
    right = -translations - np.einsum("kij,kj->ki", rotations, centers @ rotation.T)
    solution = np.linalg.lstsq(rows.reshape(-1, 6), right.reshape(-1), rcond=None)[0]
    return solution[:3], solution[3:]


def _missing_translations(
    rotations: FloatArray, translations: FloatArray, pairs: Sequence[tuple[int, int]]
) -> str | None:
    # As the flange sees them, where the rotation is sought: groups of other orientations shift otherwise in base.
    i, j = np.array(pairs, dtype=int).reshape(-1, 2).T
    shifts = np.einsum("kji,kj->ki", rotations[i], translations[j] - translations[i])
    lengths = np.linalg.norm(shifts, axis=1)
    shifts = shifts[lengths > _LEAST_SHIFT_MM]
    if len(shifts) == 0:
        return message(
            "no pure translation: two captures with the same orientation, 30 to 80 mm apart, are needed"
        )
    values = np.linalg.svd(shifts / np.linalg.norm(shifts, axis=1)[:, None], compute_uv=False)
    if len(shifts) < 2 or values[1] < _PARALLEL * values[0]:
        return message("all pure translations are parallel: one more in another direction is needed")
    return None


def _missing_orientations(rotations: FloatArray) -> str | None:
    span = orientation_span(rotations)
    if span[0] < EQUAL_ORIENTATION_RAD:
        return message(
            "one orientation only: at least three orientations, about axes that are not parallel, are needed"
        )
    if span[1] < EQUAL_ORIENTATION_RAD:
        return message("all orientations differ about one axis only: one more about another axis is needed")
    return None


def orientation_span(rotations: FloatArray) -> FloatArray:
    """Return how far orientations spread, (3,), rad, largest first: singular values of their rotation vectors."""
    vectors = vector_from_rotation(rotations[0].T @ rotations)
    values = np.asarray(np.linalg.svd(vectors - vectors.mean(axis=0), compute_uv=False), dtype=float)
    return np.concatenate([values, np.zeros(3)])[:3]
