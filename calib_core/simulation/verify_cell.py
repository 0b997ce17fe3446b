"""A cell that is verified: captures for the tool, then of the sphere, a ball bar's other one, and a flat plate."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import ON_FLANGE, FloatArray, back, pose, turn
from calib_core.simulation.profile_cell import World, pose_numbers, rounded_pose, shot_from, true_pose
from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.sensor import columns
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.writing import profile_csv, shot_files, shot_record

_BAR_MM = (180.0, 240.0, 0.0)
_TILT_RAD = 0.3
_SPREAD = 0.35  # of the plate's size: how far from its middle the stripe lies


@dataclass(frozen=True)
class VerifyScenario:
    """A session of TCP captures, and those that verify the answer; lengths in mm.

    Parameters
    ----------
    of_sphere : int
        Captures of the sphere that verify, at orientations of their own.
    of_bar : int
        Captures of the other sphere of a ball bar, whose first is that of the calibration.
    of_plate : int
        Profiles of a flat plate.
    plate_mm : tuple of float
        Its size; it lies below the sphere.
    bow_mm : float
        Its flatness: the range of its height, a paraboloid with the middle above the edges.
    tool_off_mm : float
        How far the tool that the session brings is off along y of L; none is brought where it is NaN.
    limits : dict
        Of the figures, as the session's cell states them.
    """

    description: str = "profiles of a sphere, then captures to verify: the sphere, a ball bar, a flat plate"
    tcp: TcpScenario = field(default_factory=TcpScenario)
    of_sphere: int = 10
    of_bar: int = 4
    of_plate: int = 12
    plate_mm: tuple[float, float] = (200.0, 150.0)
    bow_mm: float = 0.0
    tool_off_mm: float = float("nan")
    limits: Mapping[str, float] = field(
        default_factory=lambda: MappingProxyType(
            {"tool_mm": 2.0, "form_mm": 3.0, "spacing_mm": 1.5, "flatness_mm": 1.0, "flatness_95_mm": 0.8}
        )
    )


VERIFY_SCENARIOS: Mapping[str, VerifyScenario] = MappingProxyType({
    "verify": VerifyScenario(),
    "verify-bowed-plate": VerifyScenario("the same; the plate is bowed by 4 mm", bow_mm=4.0),
})  # fmt: skip


def verify_options(options: VerifyScenario) -> TcpScenario:
    """Return the cell's own options with as many captures as tool and verification take of the sphere."""
    return replace(options.tcp, orientations=options.tcp.orientations + options.of_sphere)


def with_verification(taken: SimulatedSession, options: VerifyScenario, seed: int) -> SimulatedSession:
    """Return a session whose last captures of the sphere verify, with those of a ball bar and of a plate added."""
    world = taken.world
    assert world is not None
    rng = np.random.default_rng([seed, 20_266])
    record = taken.session.to_json()
    captures: list[dict[str, Any]] = record["captures"]
    for capture in captures[len(captures) - options.of_sphere :]:
        capture |= {"step": "verify", "mount": "A"}
    bar, bar_files = _of_bar(world, options, rng)
    flat, flat_files, base_from_plate = _of_plate(world, options, rng)
    captures += [*bar, *flat]
    record["cell"]["verification"] = {
        **options.limits,
        "ball_bar_mm": float(np.linalg.norm(_BAR_MM)),
        "ball_bar_sigma_mm": 0.005,
    }
    if np.isfinite(options.tool_off_mm):
        tool = world.tool0_from_laser @ pose(np.eye(3), [0.0, options.tool_off_mm, 0.0])
        record["cell"]["known"] = {ON_FLANGE: tool.tolist()}
    truth = {
        **taken.truth,
        "base_from_plate": base_from_plate.tolist(),
        "plate_flatness_mm": options.bow_mm,
        "ball_bar_mm": float(np.linalg.norm(_BAR_MM)),
    }
    files = {**taken.files, **bar_files, **flat_files}
    return replace(taken, session=Session.model_validate(record), files=files, truth=truth)


def _of_bar(
    world: World, options: VerifyScenario, rng: np.random.Generator
) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Return captures of the bar's other sphere: poses that verify, moved along with it."""
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    center_in_base = world.sphere_center_in_base_mm + _BAR_MM
    for number in range(options.of_bar):
        shot = world.shots[len(world.shots) - options.of_sphere + number]
        commanded = rounded_pose(pose(np.eye(3), _BAR_MM) @ shot.commanded)
        actual = true_pose(commanded, world.options, rng)
        taken = shot_from(world, f"b{number + 1:02d}", shot.kind, commanded, actual, center_in_base, rng)
        captures.append({**shot_record(taken, world), "step": "verify", "mount": "B"})
        files |= shot_files(taken, world)
    return captures, files


def _of_plate(
    world: World, options: VerifyScenario, rng: np.random.Generator
) -> tuple[list[dict[str, Any]], dict[str, bytes], FloatArray]:
    """Return profiles of the plate from all sides, their files, and where the plate lies."""
    base_from_plate = pose(
        turn(rng.uniform(-0.05, 0.05, 3)), world.sphere_center_in_base_mm + np.array([0.0, -300.0, -100.0])
    )
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    for number in range(options.of_plate):
        row, column = divmod(number * 5 % options.of_plate, 3)
        places = np.array(
            [(column - 1) * _SPREAD, 2 * _SPREAD * row / max((options.of_plate - 1) // 3, 1) - _SPREAD]
        )
        aim = np.append((places + rng.uniform(-0.05, 0.05, 2)) * options.plate_mm, 0.0)
        around = turn([0.0, 0.0, 2 * np.pi * number / options.of_plate])
        tilted = turn([np.pi, 0.0, 0.0]) @ turn(np.append(rng.uniform(-_TILT_RAD, _TILT_RAD, 2), 0.0))
        looking = around @ tilted
        distance = (world.options.near_mm + world.options.far_mm) / 2
        plate_from_laser = pose(looking, aim - distance * looking[:, 2])
        commanded = rounded_pose(base_from_plate @ plate_from_laser @ back(world.tool0_from_laser))
        actual = true_pose(commanded, world.options, rng)
        seen = back(base_from_plate) @ actual @ world.tool0_from_laser
        name = f"f{number + 1:02d}"
        files[f"captures/{name}.csv"] = profile_csv(_profile(seen, world, options, rng), 1.0)
        captures.append(
            {"id": name, "step": "plate", "kind": "profile", "files": [f"captures/{name}.csv"]}
            | {"pose": pose_numbers(commanded)}
        )
    return captures, files, base_from_plate


def _profile(
    plate_from_laser: FloatArray, world: World, options: VerifyScenario, rng: np.random.Generator
) -> FloatArray:
    """Return the profile (M, 3) of the plate in L: where each column's ray along z meets the bowed surface."""
    x = columns(world.options)
    starts = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)]) @ plate_from_laser[:3, :3].T
    starts = starts + plate_from_laser[:3, 3]
    along = plate_from_laser[:3, 2]
    z = -starts[:, 2] / along[2]
    for _ in range(20):
        at = starts + z[:, None] * along
        z = z + (_height(at, options) - at[:, 2]) / along[2]
    at = starts + z[:, None] * along
    outside = (np.abs(at[:, :2]) > np.divide(options.plate_mm, 2)).any(axis=1)
    noise = rng.standard_normal(len(x)) * world.options.point_sigma_mm / abs(along[2])
    return np.column_stack([x, np.zeros_like(x), np.where(outside, np.nan, z + noise)])


def _height(points: FloatArray, options: VerifyScenario) -> FloatArray:
    """Return the plate's height above its mean plane's middle: its range over the plate is `bow_mm`."""
    unit = points[:, :2] / np.divide(options.plate_mm, 2)
    return -options.bow_mm * (unit**2).sum(axis=1) / 2
