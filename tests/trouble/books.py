"""What people and programs write down wrongly, and sessions that are too small."""

from collections.abc import Callable

import numpy as np

from calib_core.simulation.motion import FloatArray, pose, turn
from tests.trouble.cell import Plan, Trouble

Rng = np.random.Generator
Book = Callable[[list[list[float]], list[FloatArray], Rng], None]


def _writes(book: Book) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        plan.book = book

    return change


def _swaps(poses: list[list[float]], _profiles: list[FloatArray], rng: Rng) -> None:
    i, j = rng.choice(np.arange(4, len(poses)), 2, replace=False)
    poses[i], poses[j] = poses[j], poses[i]


def _copies(poses: list[list[float]], _profiles: list[FloatArray], rng: Rng) -> None:
    i, j = rng.choice(len(poses), 2, replace=False)
    poses[i] = list(poses[j])


def _shifted_by_one(poses: list[list[float]], _profiles: list[FloatArray], rng: Rng) -> None:
    poses[8:] = poses[9:] + poses[8:9]


def _rounds(poses: list[list[float]], _profiles: list[FloatArray], rng: Rng) -> None:
    for k, p in enumerate(poses):
        poses[k] = [round(v, 1) for v in p[:3]] + [round(v, 4) for v in p[3:]]


def _zeros(poses: list[list[float]], profiles: list[FloatArray], rng: Rng) -> None:
    for k, points in enumerate(profiles):
        missing = rng.random(len(points)) < 0.2
        profiles[k] = np.where(missing[:, None], 0.0, points)


def _zero_depths(poses: list[list[float]], profiles: list[FloatArray], rng: Rng) -> None:
    for k, points in enumerate(profiles):
        x = np.arange(-50.0, 50.0, 0.1)
        profiles[k] = np.concatenate([points, np.column_stack([x, np.zeros_like(x)])])


def _stray(poses: list[list[float]], profiles: list[FloatArray], rng: Rng) -> None:
    for k, points in enumerate(profiles):
        many = len(points) // 3
        noise = np.column_stack([rng.uniform(-50, 50, many), rng.uniform(100, 300, many)])
        profiles[k] = np.concatenate([points, noise])


def _mounting(mm: float, degrees: float) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        way, axis = rng.standard_normal(3), rng.standard_normal(3)
        moved = pose(turn(np.deg2rad(degrees) * axis / np.linalg.norm(axis)), mm * way / np.linalg.norm(way))
        when = int(rng.integers(6, 11))
        plan.mounting = lambda k: moved if k >= when else np.eye(4)

    return change


def _set(**values: object) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        for name, value in values.items():
            setattr(plan, name, value)

    return change


def _half_alike(plan: Plan, rng: Rng) -> None:
    plan.shifts, plan.tilts, plan.alike = 9, 5, 7


TROUBLES = (
    Trouble("half of 14 poses alike", _half_alike),
    Trouble("two poses swapped", _writes(_swaps)),
    Trouble("a pose is another capture's", _writes(_copies)),
    Trouble("poses shifted by one", _writes(_shifted_by_one)),
    Trouble("poses of one decimal", _writes(_rounds)),
    Trouble("missing points written as 0,0", _writes(_zeros)),
    Trouble("missing depths written as 0", _writes(_zero_depths)),
    Trouble("stray points", _writes(_stray)),
    Trouble("tool changed midway by 0.5 mm", _mounting(0.5, 0.0)),
    Trouble("tool changed midway by 0.2°", _mounting(0.0, 0.2)),
    Trouble("tool changed midway by 2 mm, 1°", _mounting(2.0, 1.0)),
    Trouble("seven captures", _set(shifts=3, tilts=4)),
    Trouble("tilts of 10°", _set(tilt_rad=0.17)),
    Trouble("no shifts", _set(shifts=0, tilts=14)),
    Trouble("near great circles", _set(offset=(0.0, 0.2))),
    Trouble("always one side", _set(one_side=True)),
    Trouble("forty captures", _set(shifts=8, tilts=32), clean=True),
)
