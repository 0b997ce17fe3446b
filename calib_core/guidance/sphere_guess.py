"""Where the sphere probably is before the first solve: so that a proposed turn keeps it in view."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from calib_core.frames import FloatArray, RigidTransform

_SCANNER_REACH_MM = 150.0  # a scanner sits so near to the flange, as far as nothing else is known
_ROW_SIGMA_MM = 1.0  # a centre in L, with what an error of the rotation does to it
_LEAST_SPREAD_MM = 8.0  # of the shifts in their weakest direction
_MOST_OPEN_SIDES = 6


@dataclass(frozen=True, eq=False)
class SeenCenter:
    """The sphere's centre as one capture sees it in L.

    Attributes
    ----------
    base_from_tool0 : RigidTransform
    center_mm : (3,)
        Of a profile, y is what Pythagoras gives, without its sign.
    open_side : bool
        Whether the sign of y is not known.
    """

    base_from_tool0: RigidTransform
    center_mm: FloatArray
    open_side: bool


@dataclass(frozen=True, eq=False)
class ProbablePlace:
    """A guess of the sphere's place.

    Attributes
    ----------
    center_in_base_mm : (3,)
    scanner_sigma_mm : float
        How far the scanner's place on the flange, on which the guess rests, may be off in its weakest direction.
    mount_from_laser : RigidTransform
        The scanner's place as it is guessed.
    """

    center_in_base_mm: FloatArray
    scanner_sigma_mm: float
    mount_from_laser: RigidTransform


def probable_place(shifted: Sequence[SeenCenter], turned: Sequence[SeenCenter]) -> ProbablePlace | None:
    """Guess where the sphere is from shifts, and from what turns there are.

    Shifts d (in tool0) move the sphere's centre in L by X_Rᵀ d, which gives the scanner's rotation X_R by linear
    least squares and the nearest rotation; profiles lack y, which is then the cross product.  With X_R fixed, the
    sphere's centre and the scanner's place are linear in the centres.  Of the sides of profiles those are taken
    that fit best.  What turns do not tell of the scanner's place yet is taken to be zero, give or take 150 mm: it
    sits at the flange.

    Parameters
    ----------
    shifted : sequence of SeenCenter
        Of poses that are pure translations of each other.
    turned : sequence of SeenCenter
        Of other poses; the last six are looked at.

    Returns
    -------
    ProbablePlace or None
        None where the shifts do not span space.
    """
    rotation = _rotation(shifted)
    if rotation is None:
        return None
    known = _with_sides(rotation, shifted)
    open_ones = list(turned[-_MOST_OPEN_SIDES:])
    choices = product(*([(1.0, -1.0) if one.open_side else (1.0,) for one in open_ones]))
    solved = [
        _solved(rotation, [*known, *(_signed(one, side) for one, side in zip(open_ones, sides, strict=True))])
        for sides in choices
    ]
    return min(solved, key=lambda found: found[1])[0]


def _signed(seen: SeenCenter, side: float) -> SeenCenter:
    return SeenCenter(seen.base_from_tool0, seen.center_mm * np.array([1.0, side, 1.0]), False)


def _moves(shifted: Sequence[SeenCenter]) -> FloatArray:
    """Return how the sphere moved in tool0 from the first capture to each of the others (N, 3)."""
    home = shifted[0].base_from_tool0
    return np.array(
        [home.rotation.T @ (home.translation_mm - one.base_from_tool0.translation_mm) for one in shifted[1:]]
    )


def _rotation(shifted: Sequence[SeenCenter]) -> FloatArray | None:
    """Return X_R (3, 3), or None where the shifts do not span space."""
    if len(shifted) < 4 or np.linalg.svd(_moves(shifted), compute_uv=False)[-1] < _LEAST_SPREAD_MM:
        return None
    axes = [0, 2] if any(one.open_side for one in shifted) else [0, 1, 2]
    seen = np.array([one.center_mm - shifted[0].center_mm for one in shifted[1:]])[:, axes]
    left, _, right = np.linalg.svd(np.linalg.lstsq(_moves(shifted), seen, rcond=None)[0], full_matrices=False)
    columns = left @ right
    if len(axes) == 2:
        x, z = columns.T
        return np.column_stack([x, np.cross(z, x), z])
    return columns if np.linalg.det(columns) > 0 else None


def _with_sides(rotation: FloatArray, shifted: Sequence[SeenCenter]) -> list[SeenCenter]:
    """Return shifted captures with the sides on which their heights fit the shifts."""
    if not any(one.open_side for one in shifted):
        return list(shifted)
    steps = np.concatenate([[0.0], _moves(shifted) @ rotation[:, 1]])
    heights = np.array([one.center_mm[1] for one in shifted])
    ways = [side * heights[0] + steps for side in (1.0, -1.0)]
    way = min(ways, key=lambda told: float(np.sum((np.abs(told) - heights) ** 2)))
    return [_signed(one, 1.0 if y >= 0 else -1.0) for one, y in zip(shifted, way, strict=True)]


def _solved(rotation: FloatArray, seen: Sequence[SeenCenter]) -> tuple[ProbablePlace, float]:
    """Solve X_Rᵀ (R_kᵀ (c − T_k) − t) = p_k for sphere's centre c and scanner's place t; return it with its χ²."""
    rows: list[FloatArray] = [np.hstack([np.zeros((3, 3)), np.eye(3)]) / _SCANNER_REACH_MM]
    right: list[FloatArray] = [np.zeros(3)]
    for one in seen:
        to_laser = (one.base_from_tool0.rotation @ rotation).T
        rows.append(np.hstack([to_laser, -rotation.T]) / _ROW_SIGMA_MM)
        right.append((one.center_mm + to_laser @ one.base_from_tool0.translation_mm) / _ROW_SIGMA_MM)
    matrix, wanted = np.vstack(rows), np.concatenate(right)
    found = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    covariance = np.linalg.pinv(matrix.T @ matrix)[3:, 3:]
    place = ProbablePlace(
        np.array(found[:3], dtype=np.float64),
        float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])),
        RigidTransform.of(rotation, found[3:], "tool0", "laser"),
    )
    return place, float(np.sum((matrix @ found - wanted) ** 2))
