"""Where the fit starts while linear axes carry the robot: along which way each of them goes.

Each way is tried from everywhere, all at once: the robot's recorded places are shifted by the readings along it,
and many rotations of the scanner are refined.  About the best, what is left over is linear in the ways.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from calib_core.chain.start import Centers, Start, badness, find_starts
from calib_core.chain.start_search import Sought, random_rotations
from calib_core.frames import FloatArray

_ROTATIONS, _KEPT, _ROUNDS = 40, 6, 12
_SETTLED_MM = 1e-3


def find_ways(centers: Centers, readings: FloatArray) -> tuple[FloatArray, list[Start]]:
    """Return the ways (A, 3) of linear axes under the robot and the starts that they allow, the likeliest first.

    Parameters
    ----------
    centers : Centers
        Of a ball in base.
    readings : (K, A)
        Of these axes, mm.
    """
    count = readings.shape[1]
    every = [np.array(ways) for ways in product(_unit(), repeat=count)]
    every.sort(key=lambda ways: _scatter(shifted(centers, readings, ways)))
    found = [_improved(centers, readings, ways) for ways in every[:_KEPT]]
    return min(found, key=lambda one: badness(one[1][0]))


def shifted(centers: Centers, readings: FloatArray, ways: FloatArray, over_robot: int = 1) -> Centers:
    """Return centres as seen from where axes (K, A) along ways (A, 3) carried the robot, or its ball (−1)."""
    moved = readings @ ways
    if over_robot < 0:
        moved = -np.einsum("kij,kj->ki", centers.rotations, moved)
    return replace(centers, translations=centers.translations + moved)


def _unit() -> FloatArray:
    grid = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    return grid / np.linalg.norm(grid, axis=1)[:, None]


def _scatter(centers: Centers) -> float:
    weight = np.ones_like(centers.measured)
    weight[:, 1] = np.where(centers.open_side, 0.0, centers.height_weight)
    sought: Sought = centers.sought(weight)
    rotations = random_rotations(_ROTATIONS)
    _, _, misfit = sought.refined(rotations, sought.linear_unknowns(rotations), 12)
    return float(np.median(sought.distances(misfit), axis=1).min())


def _improved(centers: Centers, readings: FloatArray, ways: FloatArray) -> tuple[FloatArray, list[Start]]:
    """Return better ways, with what they leave over taken out again and again."""
    starts = find_starts(shifted(centers, readings, ways))
    for _ in range(_ROUNDS):
        best = starts[0]
        moved = shifted(centers, readings, ways)
        signed, height = centers.measured.copy(), centers.measured[:, 1]
        signed[:, 1] = np.where(best.sides == 0, height, np.abs(height) * best.sides)
        in_base = np.einsum("kij,kj->ki", moved.rotations, signed @ best.rotation.T + best.translation)
        off = in_base + moved.translations - best.center
        scale = max(3 * best.scatter_mm, 1.0)
        weight = 1 / (1 + (np.linalg.norm(off, axis=1) / scale) ** 2)
        rows = np.column_stack([readings, np.ones(len(readings))]) * np.sqrt(weight)[:, None]
        step = np.linalg.lstsq(rows, -off * np.sqrt(weight)[:, None], rcond=None)[0][:-1]
        better = ways + step
        better = better / np.linalg.norm(better, axis=1)[:, None]
        if np.abs((better - ways) * np.ptp(readings, axis=0)[:, None]).max() < _SETTLED_MM:
            break
        ways, starts = better, find_starts(shifted(centers, readings, better))
    return ways, starts
