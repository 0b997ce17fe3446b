"""Simulated sweeps across the sphere: the scanner moves along y of L, a profile at each step.

Half of the sweeps state a pose a profile, the others times and a coarser track of poses.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import FloatArray, turn
from calib_core.simulation.motion import pose as place
from calib_core.simulation.profile_cell import World, build_world, commanded_pose, measure, pose_numbers, true_pose
from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.writing import profile_csv, session_record

_STEP_S = 0.02
_TRACK_EVERY = 4


@dataclass(frozen=True)
class SweepScenario:
    """Sweeps at orientations of their own.  Each pose has an error of its own, unless a sweep's poses share it.

    Parameters
    ----------
    sweeps, profiles : int
        How many sweeps, and profiles in each.
    reach : float
        A sweep goes this many radii to both sides of the sphere's middle; beyond 1 the stripe misses the sphere.
    cell : TcpScenario
        Sphere, scanner and robot.
    shared : float
        Which part (0 to 1) of the pose errors' variance all poses of a sweep have in common.
    """

    description: str
    sweeps: int = 6
    profiles: int = 25
    reach: float = 1.3
    cell: TcpScenario = field(default_factory=TcpScenario)
    shared: float = 0.0


SWEEP_SCENARIOS: Mapping[str, SweepScenario] = MappingProxyType(
    {
        "tcp-sweep": SweepScenario("six sweeps across the sphere, each at an orientation of its own"),
        "tcp-sweep-shared": SweepScenario("ten sweeps; the arm errs alike along each", sweeps=10, shared=0.9),
    }
)


def simulate_sweeps(
    options: SweepScenario, name: str, seed: int
) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session record, its files and the truth of a scenario of sweeps."""
    rng = np.random.default_rng([seed, 20_262])
    world = build_world(options.cell, rng)
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    actual: dict[str, list[Any]] = {}
    for number in range(options.sweeps):
        name_of_sweep = f"s{number + 1:02d}"
        poses = _commanded(world, world.shots[options.cell.translations + number].commanded, options, rng)
        true = _true_poses(poses, options, rng)
        names = [f"captures/{name_of_sweep}/{k + 1:03d}.csv" for k in range(len(poses))]
        for file, pose in zip(names, true, strict=True):
            measured = measure(options.cell.kinds[0], world, pose, world.sphere_center_in_base_mm, rng)[2]
            files[file] = profile_csv(measured, 1.0)
        actual[name_of_sweep] = [pose.tolist() for pose in true]
        record = {"id": name_of_sweep, "step": "tcp", "kind": "sweep", "files": names}
        captures.append(record | (_timed(poses) if number % 2 else {"poses": [pose_numbers(p) for p in poses]}))
    record = session_record(world, f"simulated {name}, seed {seed}").to_json()
    record["captures"] = captures
    truth = {**world.truth(), "base_from_tool0": actual, "sides": {}, "seed": seed, "scenario": name}
    return Session.model_validate(record), files, truth


def _commanded(
    world: World, about: FloatArray, options: SweepScenario, rng: np.random.Generator
) -> list[FloatArray]:
    """Return the poses of a straight sweep at equal steps, its orientation near that of a pose."""
    radius = options.cell.sphere_diameter_mm / 2
    x = rng.uniform(-1, 1) * options.cell.lateral_mm / 2
    z = rng.uniform(options.cell.near_mm, options.cell.far_mm)
    rotation = about[:3, :3] @ turn(rng.standard_normal(3) * options.cell.equal_orientation_sigma_rad)
    across = np.linspace(-options.reach, options.reach, options.profiles) * radius
    return [commanded_pose(world, rotation, np.array([x, y, z])) for y in across]


def _true_poses(poses: list[FloatArray], options: SweepScenario, rng: np.random.Generator) -> list[FloatArray]:
    """Return where the arm really was: off by errors of its own at each pose, and by what the sweep shares."""
    own, common = (_with_errors(options.cell, part) for part in (1 - options.shared, options.shared))
    true = [true_pose(pose, own, rng) for pose in poses]
    if not options.shared:
        return true
    still = true_pose(np.eye(4), common, rng)
    shift, turned = still[:3, 3], still[:3, :3]
    return [place(pose[:3, :3] @ turned, pose[:3, 3] + shift) for pose in true]


def _with_errors(cell: TcpScenario, part: float) -> TcpScenario:
    scale = float(np.sqrt(part))
    position, turning = cell.position_sigma_mm * scale, cell.orientation_sigma_rad * scale
    return replace(cell, position_sigma_mm=position, orientation_sigma_rad=turning)


def _timed(poses: list[FloatArray]) -> dict[str, Any]:
    """Return times a profile, and a track that has every fourth pose and the last."""
    last = len(poses) - 1
    sampled = sorted({*range(0, len(poses), _TRACK_EVERY), last})
    return {
        "timestamps_s": [round(k * _STEP_S, 6) for k in range(len(poses))],
        "pose_track": [{"t_s": round(k * _STEP_S, 6), "pose": pose_numbers(poses[k])} for k in sampled],
    }
