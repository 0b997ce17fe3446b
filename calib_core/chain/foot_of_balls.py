"""How linear axes under a robot lie by arcs of several balls that nobody told apart.

Few arcs of one ball fix scanner, ball and the axes' ways together, by x and z of their centres.  So these are
sought from many random few, each from a random rotation, and the guess is taken by which most arcs come together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.cell.layout import AxisState, Layout
from calib_core.chain.guesses import random_rotations
from calib_core.chain.observations import Observations, SphereSize
from calib_core.chain.start import centers_of
from calib_core.frames import FloatArray, nearest_rotation, rotation_from_vector, skew, with_third

_DRAWS, _STEPS, _BEST, _SETTLING = 8000, 14, 12, 6
_TOGETHER_MM = 3.0
_LONGEST_TURN = 0.5  # rad, of one step
_LENGTHS = (0.95, 1.05)  # of a way in mm that is read in mm
_LEAST_SHARE, _MORE = 0.25, 2  # of all arcs, and more than the few, come together by a guess that is one
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class _Arcs:
    """Arcs of N guesses: how balls move before the scanner's carrier (N, k, 3, m), the rest, centres, weights."""

    parts: FloatArray
    fixed: FloatArray
    measured: FloatArray
    weight: FloatArray

    def chosen(self, which: np.ndarray) -> "_Arcs":
        return _Arcs(*(each[0, which] for each in (self.parts, self.fixed, self.measured, self.weight)))

    def off(self, rotations: FloatArray, linear: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what guesses leave over of the centres in L, weighted, and where the balls are before it."""
        places = np.matmul(self.parts, linear[:, None, :-3, None])[..., 0] + self.fixed
        places = places @ rotations
        return (places - linear[:, None, -3:] - self.measured) * self.weight, places

    def refined(self, rotations: FloatArray, linear: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """Return guesses after steps of Gauss and Newton."""
        for _ in range(steps):
            off, places = self.off(rotations, linear)
            moves = np.swapaxes(rotations, 1, 2)[:, None] @ self.parts
            shifts = np.broadcast_to(-np.eye(3), (*moves.shape[:2], 3, 3))
            columns = np.concatenate([skew(places), moves, shifts], axis=3) * self.weight[..., None]
            rows = columns.reshape(len(columns), -1, columns.shape[3])
            normal = np.swapaxes(rows, 1, 2) @ rows
            scale = np.einsum("nii->ni", normal) + 1e-12
            normal += _RIDGE * scale[:, :, None] * np.eye(normal.shape[1])
            slope = np.swapaxes(rows, 1, 2) @ off.reshape(len(off), -1, 1)
            step = -np.linalg.solve(normal, slope)[..., 0]
            length = np.linalg.norm(step[:, :3], axis=1)
            turns = step[:, :3] / np.maximum(length / _LONGEST_TURN, 1.0)[:, None]
            rotations = nearest_rotation(rotations @ np.array([rotation_from_vector(one) for one in turns]))
            linear = linear + step[:, 3:]
        return rotations, linear


def linear_feet(arcs: Observations, sphere: SphereSize, layout: Layout) -> tuple[AxisState, ...] | None:
    """Return how the axes of a layout, linear and under the robot, lie by one scanner's arcs; None if unknown."""
    centers, axes = centers_of(arcs, sphere), layout.axes
    few = (3 + 3 * len(axes) + 6) // 2 + 1
    if any(axis.kind == "rotary" for axis in axes) or len(arcs) < 2 * few:
        return None
    readings = np.array([[o.readings.get(axis.name, 0.0) for axis in axes] for o in arcs])
    # base_from_tool0 of a ball on the flange, tool0_from_base of one in base
    back = np.swapaxes(centers.rotations, 1, 2)
    over = arcs[0].carriers.over_robot
    ways = -over * readings[:, None, :, None] * np.eye(3)[:, None, :]
    still = np.broadcast_to(np.eye(3), back.shape)
    parts = np.concatenate([still, ways.reshape(len(arcs), 3, -1)], axis=2)
    if over > 0:
        parts = back @ parts
    else:
        parts[:, :, :3] = back
    fixed = -np.einsum("kij,kj->ki", back, centers.translations)
    weight = np.ones_like(centers.measured)
    weight[:, 1] = np.where(centers.open_side, 0.0, centers.height_weight)
    every = _Arcs(parts[None], fixed[None], centers.measured[None], weight[None])
    some = every.chosen(_of_different_captures([o.capture for o in arcs], few))
    rotations = random_rotations(_DRAWS)
    linear = np.zeros((_DRAWS, parts.shape[2] + 3))
    rotations, linear = some.refined(rotations, linear, _STEPS)
    lengths = np.linalg.norm(linear[:, 3:-3].reshape(_DRAWS, -1, 3), axis=2)
    likely = np.flatnonzero(((lengths > _LENGTHS[0]) & (lengths < _LENGTHS[1])).all(axis=1))
    if not len(likely):
        return None
    rotations, linear = rotations[likely], linear[likely]
    near = np.linalg.norm(every.off(rotations, linear)[0], axis=2) < _TOGETHER_MM
    best = np.argsort(-near.sum(axis=1), kind="stable")[:_BEST]
    found = [_settled(every, rotations[n], linear[n], near[n]) for n in best]
    linear, together = max(found, key=lambda one: one[1])
    if together < max(_LEAST_SHARE * len(arcs), few + _MORE):
        return None
    along = linear[3:-3].reshape(-1, 3)
    return tuple(AxisState(with_third(way / np.linalg.norm(way)), np.zeros(3)) for way in along)


def _settled(every: _Arcs, rotation: FloatArray, linear: FloatArray, near: np.ndarray) -> tuple[FloatArray, int]:
    """Return a guess by all arcs that come together by it, and how many these are."""
    rotations, unknowns = rotation[None], linear[None]
    for _ in range(_SETTLING):
        if 2 * near.sum() < len(linear) + 3:
            break
        own = every.chosen(np.flatnonzero(near)[None])
        rotations, unknowns = own.refined(rotations, unknowns, 3)
        near = np.linalg.norm(every.off(rotations, unknowns)[0][0], axis=1) < _TOGETHER_MM
    return unknowns[0], int(near.sum())


def _of_different_captures(captures: Sequence[str], few: int) -> np.ndarray:
    """Return so many arcs for each draw, (draws, few), no two of one capture, the same every time."""
    _, own = np.unique(captures, return_inverse=True)
    keys = np.random.default_rng(len(own)).random((_DRAWS, len(own)))
    first = np.zeros((_DRAWS, own.max() + 1))
    np.maximum.at(first.T, own, keys.T)
    keys = np.where(keys == first[:, own], keys, -keys)
    return np.argpartition(-keys, few - 1, axis=1)[:, :few]
