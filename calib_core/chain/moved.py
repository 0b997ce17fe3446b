"""What an answer becomes where all its captures' points move a little: by an error of camera or plane of light."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib_core.chain.held import Held, point_rows
from calib_core.chain.likelihood import linearised_at
from calib_core.chain.scanner import COUNT
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray

OpticsSource = Literal["camera", "plane"]


@dataclass(frozen=True, eq=False)
class OpticsError:
    """What one standard deviation of camera or plane of light, along one direction, does to answer and points.

    Attributes
    ----------
    source : {"camera", "plane"}
        Whose error: the plane's is what the camera's leaves open.
    step : (P,)
        By how much the answer moves: the unknowns and the nuisances, as in `Held.covariance`.
    at_mm : (3,)
        A point of L where the scanner sees the workpiece.
    point_mm, by_place : (3,), (3, 3)
        By how much a point that is measured there moves in L, and how that changes with the place.
    """

    source: OpticsSource
    step: FloatArray
    at_mm: FloatArray
    point_mm: FloatArray
    by_place: FloatArray


def shift_by(held: Held, points: FloatArray) -> FloatArray:
    """Return by how much an answer's unknowns and nuisances move (P,) where its points move.

    Captures, sides, weights and sigmas stay; the new minimum lies where the likelihood's slope, which the moved
    points change, is taken out again by its curvature: one Gauss–Newton step.

    Parameters
    ----------
    held : Held
    points : (M, 3)
        Those of `held.data`, moved.
    """
    # About the same state with the same noise: what settling leaves over is in both.
    before = linearised_at(held.data, held.state, held.sigmas)
    after = linearised_at(replace(held.data, points=np.ascontiguousarray(points)), held.state, held.sigmas)
    step = covariance_of(before.hessian) @ (before.gradient - after.gradient)
    size = len(held.covariance)
    kept = np.zeros(size)
    unknowns = size - len(held.active)
    kept[:unknowns] = step[:unknowns]
    if held.applied:  # only what is taken out of the points moves an answer
        sought = held.data.active
        found = np.zeros(len(held.data.kinds))
        found[sought] = step[before.nuisances]
        kept[unknowns:] = np.where(held.data.of_files, found, 0.0)[held.active]
    return kept


def spread_of(errors: Sequence[OpticsError], size: int) -> FloatArray:
    """Return the covariance (size, size) of an answer by independent errors."""
    steps = np.array([error.step for error in errors]).reshape(-1, size)
    return steps.T @ steps


def at_point_by(held: Held, errors: Sequence[OpticsError]) -> FloatArray:
    """Return the covariance (3, 3), mm², that errors add to a measured point, along the flange's axes.

    A scan's points move with camera and plane as the captures' points did: with the tool, both largely cancel.
    """
    total = np.zeros((3, 3))
    for error in errors:
        rows = point_rows(held.state.tool_rotation, error.at_mm, held.half_width_mm, held.facing)
        rows = rows[:, np.concatenate([np.arange(6), 6 + held.active[held.active < COUNT]])]
        moved = rows @ error.step[held.tool_and_scanner] + held.state.tool_rotation @ error.point_mm
        total += np.outer(moved, moved)
    return total
