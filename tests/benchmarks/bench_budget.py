"""The error budget at points of simulated cells: measured points' errors in T beside the stated covariance.

What is stated is judged over cells that err as is believed of scanners, arms and spheres (`believed_cells`).
Beside them stand cells that err in noise alone: there the stated figure is too large by what they have nothing of.

Each cell is calibrated as a whole; then points of its workpiece are measured by the true chain, each from its own
pose and table angle, with fresh errors of arm, encoder and scanner, and brought into T by the chain as solved.
"""

from dataclasses import dataclass

import numpy as np
from believed_cells import measured
from harness import Row

from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.guidance.budget import known_offset, stated, within_95
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage

POINTS = 20


@dataclass(frozen=True, eq=False)
class Points:
    """Of one cell's points, mm: errors (N, 3), stated covariances (N, 3, 3), half the 95 % intervals (N, 3)."""

    errors_mm: FloatArray
    covariances: FloatArray
    within_mm: FloatArray


def one(seed: int, points: int = POINTS) -> Points:
    """Calibrate a cell and measure points of its workpiece."""
    simulated = simulate("turntable", seed)
    world, table = simulated.world, simulated.table
    assert world is not None
    assert table is not None
    result = solve_stage(simulated.session, "chain", simulated.files.__getitem__).to_json()
    known = Calibrated.of(result)
    assert known.base_from_turntable is not None
    rng = np.random.default_rng([seed, 80])
    options, errors, covariances, halves = world.options, [], [], []
    shots = [shot for shot in world.shots if shot.table is not None]
    tool, truth = world.tool0_from_laser, table.base_from_turntable
    solved_tool, solved_table = known.mount_from_laser.matrix, known.base_from_turntable.matrix
    for _ in range(points):
        shot = shots[rng.integers(len(shots))]
        assert shot.table is not None
        place = np.array([*rng.uniform(-100, 100, 2), rng.uniform(0, 250)])
        seen = np.array([rng.uniform(-20, 20), 0.0, rng.uniform(140, 220)])
        rotation = shot.commanded[:3, :3]
        # The angle as the table truly turned, and as its encoder reads it with a fresh error.
        angle = shot.table.angle_rad
        read = table.options.direction * (angle + rng.standard_normal() * table.options.angle_sigma_rad)
        actual = np.eye(4)
        actual[:3, :3] = rotation
        in_base = truth @ np.append(rotation_from_vector(np.array([0, 0, angle])) @ place, 1.0)
        actual[:3, 3] = in_base[:3] - rotation @ (tool @ np.append(seen, 1.0))[:3]
        reported = actual.copy()
        reported[:3, :3] = rotation @ rotation_from_vector(rng.standard_normal(3) * options.orientation_sigma_rad)
        reported[:3, 3] += rng.standard_normal(3) * options.position_sigma_mm
        measured = seen + np.array([0, 0, rng.standard_normal() * options.point_sigma_mm])
        told = reported @ solved_tool @ np.append(measured, 1.0)
        back = rotation_from_vector(np.array([0, 0, -known.direction * read]))
        found = back @ (np.linalg.inv(solved_table) @ told)[:3]
        errors.append(found - place)
        view = View(rotation, read, seen)
        covariances.append(stated(known, view, place))
        halves.append(within_95(known_offset(known, view, place)[None], covariances[-1][None]))
    return Points(np.array(errors), np.array(covariances), np.array(halves))


def as_believed(seed: int, points: int = POINTS) -> Points:
    """Calibrate a cell that errs as is believed of cells, and measure points of its workpiece."""
    return Points(*measured(seed, points))


def rows(found: list[Points], what: str = "budget, cells as believed") -> list[Row]:
    """Return the figures of some cells; those of cells without what is believed have no target."""
    errors, covariances = (
        np.concatenate([p.errors_mm for p in found]),
        np.concatenate([p.covariances for p in found]),
    )
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    ratio = float(np.mean(errors**2 / variances))
    share = float(np.mean(np.abs(errors) <= np.concatenate([p.within_mm for p in found])))
    text = f"{ratio:.3f} ({len(found)} cells, {np.sqrt(np.mean(errors**2)):.3f} mm per axis)"
    covered = f"{100 * share:.1f} %"
    if what != "budget, cells as believed":
        return [
            Row(f"{what}: mean squared error / stated variance", "below 1", text),
            Row(f"{what}: 95 % intervals that hold the truth", "", covered),
        ]
    return [
        Row(f"{what}: mean squared error / stated variance", "0.85 … 1.15", text, 0.85 <= ratio <= 1.15),
        Row(f"{what}: 95 % intervals that hold the truth", "93 … 97 %", covered, 0.93 <= share <= 0.97),
    ]


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 500 cells of the target."""
    return [
        *rows([as_believed(seed) for seed in range(500 if full else 12)]),
        *rows([one(seed) for seed in range(100 if full else 6)], "budget, cells that err in noise alone"),
    ]
