"""Next-pose advice followed for twelve captures, beside random poses that pass the same checks, and exchange.

A hundred simulated cells, each with its own sphere, field, tilt limits, tool and noise. In each the advice is
followed capture by capture; all sets are judged by the covariance at the workpiece of the solver's likelihood.
"""

import statistics
import time
from dataclasses import dataclass, replace

import numpy as np
from harness import Row

from calib_core.chain.chain_data import Sigmas
from calib_core.chain.observations import SphereSize
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.guidance.candidates import Room, candidates
from calib_core.guidance.design import Assumed, Design, worst_sigma
from calib_core.guidance.field_of_view import Sight
from calib_core.guidance.planner import Situation, exchanged, greedy, next_pose
from calib_core.records.planning import Limits

CAPTURES, GRID, RANDOM_SETS = 12, 2000, 25


@dataclass(frozen=True)
class Compared:
    """One cell: standard deviations at the workpiece, mm, and the longest advice, s."""

    advised_mm: float
    random_mm: float
    exchange_mm: float | None
    slowest_s: float


def cell(seed: int) -> Situation:
    """Draw a cell: sphere of 24 to 50 mm, field of 60 to 120 mm, tilts of 15 to 30 degrees, an ordinary arm."""
    rng = np.random.default_rng([seed, 77])
    radius, near = rng.uniform(12, 25), rng.uniform(100, 200)
    half = radius + rng.uniform(8, 25)
    sight = Sight(
        near_mm=near,
        far_mm=near + rng.uniform(60, 120),
        near_half_width_mm=half,
        far_half_width_mm=half * rng.uniform(1, 1.3),
        pitch_mm=rng.uniform(0.05, 0.2),
        point_sigma_mm=rng.uniform(0.01, 0.04),
    )
    turn, place = (
        rng.uniform(-0.3, 0.3, 3) - np.array([0, 0, 1.6]),
        np.array([35, -120, 140]) + rng.uniform(-40, 40, 3),
    )
    home = rotation_from_vector(np.array([np.pi, 0, 0])) @ rotation_from_vector(rng.uniform(-0.2, 0.2, 3))
    assumed = Assumed(
        SphereSize(2 * radius),
        RigidTransform.of(turn, place, "tool0", "laser"),
        np.array([900.0, 150.0, 420.0]),
        Sigmas(rng.uniform(0.03, 0.1), rng.uniform(1e-4, 3e-4), (1e-4,), 0.03, 7e-5, 1.0),
        sight.middle_mm,
        tool_sigma_mm=10.0,
        tool_sigma_rad=0.05,
    )
    limits = Limits(tilt_deg=rng.uniform(15, 30), turn_deg=rng.uniform(15, 40))
    return Situation([], assumed, Room(sight, limits, home))


def compare(seed: int, with_exchange: bool) -> Compared:
    """Follow the advice in one cell, and compare."""
    start = cell(seed)
    given, room = start.assumed, start.room
    radius = given.sphere.radius_mm
    now, slowest = replace(start, taken=[*start.taken, start.seen_from(start.proposed(1))[0]]), 0.0
    while len(now.taken) < CAPTURES:
        begin = time.perf_counter()
        best = next_pose(now)
        slowest = max(slowest, time.perf_counter() - begin)
        assert best is not None
        seen = room.sight.observation(f"p{len(now.taken)}", best.base_from_tool0, best.center_in_laser_mm, radius)
        now = replace(now, taken=[*now.taken, seen])
    advised = float(worst_sigma(Design(now.taken, given).workpiece(range(CAPTURES))))
    rng = np.random.default_rng([seed, 78])
    poses = candidates(room, given.mount_from_laser, given.center_mm, radius, 400, rng, at_edge=0.0)
    some = Design(start.seen_from(poses), given)
    sets = [sorted(rng.choice(len(poses), CAPTURES, replace=False).tolist()) for _ in range(RANDOM_SETS)]
    random = float(np.median([worst_sigma(some.workpiece(one)) for one in sets]))
    return Compared(advised, random, _exchange_mm(start, seed) if with_exchange else None, slowest)


def _exchange_mm(start: Situation, seed: int) -> float:
    grid = Design(start.seen_from(start.proposed(GRID, seed + 5000)), start.assumed)
    best = exchanged(grid, [], greedy(grid, [], CAPTURES), sweeps=3)
    return float(worst_sigma(grid.workpiece(best)))


def rows(found: list[Compared]) -> list[Row]:
    """Return the figures of some cells."""
    ratio = statistics.median(c.advised_mm / c.random_mm for c in found)
    text = f"{ratio:.3f} ({len(found)} cells, {statistics.median(c.advised_mm for c in found):.3f} mm)"
    made = [Row("12 advised captures / random ones that pass the same checks", "≤ 0.7", text, ratio <= 0.7)]
    beside = [c.advised_mm / c.exchange_mm for c in found if c.exchange_mm is not None]
    if beside:
        ratio = statistics.median(beside)
        text = f"{ratio:.3f} ({len(beside)} cells, worst {max(beside):.3f})"
        made.append(Row(f"12 advised captures / best exchange of {GRID} poses", "≤ 1.1", text, ratio <= 1.1))
    slow = statistics.median(c.slowest_s for c in found)
    made.append(Row("longest advice of a cell, median", "≤ 1 s", f"{slow:.2f} s", slow <= 1.0))
    return made


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the target's 100 cells, a third of them with exchange."""
    next_pose(cell(0))  # compiles
    cells = 100 if full else 6
    return rows([compare(seed, with_exchange=seed % 3 == 0) for seed in range(cells)])
