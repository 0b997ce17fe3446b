"""How far frames and axes of a simulated cell are from the truth, as squared distances in what is stated."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from calib_core.frames import RigidTransform

Distance = tuple[str, float, int, float]
"""Of what, the squared distance, its degrees of freedom, and the error in mm (of a direction in degrees)."""


def distances(result: Any, truth: dict[str, Any]) -> Iterator[Distance]:
    """Give every scanner's frame, relative poses of scanners, and every axis of a result."""
    told = {(f["into"], f["outof"], f.get("scanner")): np.array(f["matrix"]) for f in truth["frames"]}
    lasers = {name: matrix for (_, outof, name), matrix in told.items() if outof == "laser"}
    for frame in result.frames:
        if frame.outof == "laser":
            true = told[frame.into, "laser", frame.scanner or next(iter(lasers))]
        elif frame.into.startswith("laser:"):
            true = np.linalg.inv(lasers[frame.into[6:]]) @ lasers[frame.outof[6:]]
        else:
            continue
        off = _transform(frame.matrix).difference(_transform(true))
        squared = float(off @ np.linalg.solve(np.array(frame.covariance), off))
        yield f"{frame.into}_from_{frame.outof}", squared, 6, float(np.linalg.norm(off[3:]))
    for axis in result.axes:
        yield _axis(axis, next(one for one in truth["axes"] if one["name"] == axis.name))


def _axis(axis: Any, truth: dict[str, Any]) -> Distance:
    found, true = np.array(axis.axis_direction), np.array(truth["axis_direction"])
    true = true * np.sign(true @ found)
    values, vectors = np.linalg.eigh(_of_direction(axis, found))
    across = vectors[:, 1:].T @ (true - found)  # along itself a direction does not move
    squared = float(np.sum(across**2 / values[1:]))
    return axis.name, squared, 2, float(np.rad2deg(np.linalg.norm(across)))


def _of_direction(axis: Any, direction: np.ndarray) -> np.ndarray:
    """Return the covariance (3, 3) of an axis's direction, both tilts as uncertain."""
    tilt = 0.5 * (axis.covariance[0][0] + axis.covariance[1][1])
    return tilt * (np.eye(3) - np.outer(direction, direction))


def _transform(rows: Any) -> RigidTransform:
    matrix = np.array(rows)
    return RigidTransform.of(matrix[:3, :3], matrix[:3, 3], "base", "tool0")
