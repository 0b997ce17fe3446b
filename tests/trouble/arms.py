"""Arms that err: joints, links, gears, sag, lengths, tails, lags."""

from collections.abc import Callable

import numpy as np

from calib_core.simulation.motion import FloatArray, pose, turn
from tests.trouble.arm import ArmErrors
from tests.trouble.cell import Plan, Trouble

Rng = np.random.Generator


def _kinematic(joints_deg: float, lengths_mm: float, gears_deg: float = 0.0, sag_deg: float = 0.0):
    def change(plan: Plan, rng: Rng) -> None:
        phases = rng.uniform(0, 2 * np.pi, 6)
        plan.arm = ArmErrors(
            np.deg2rad(joints_deg) * rng.standard_normal(6),
            lengths_mm * rng.standard_normal(6),
            np.deg2rad(joints_deg) * rng.standard_normal(6),
            np.column_stack([np.deg2rad(gears_deg) * rng.standard_normal(6), phases]),
            np.deg2rad(sag_deg) / 1000,
        )

    return change


def _random(position_mm: float, orientation_deg: float) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        plan.position_mm, plan.orientation_rad = position_mm, float(np.deg2rad(orientation_deg))

    return change


def _scaled(share: float) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        plan.too_long = 1 / (1 + share) - 1
        plan.pose_error = lambda p, k, rng: pose(p[:3, :3], p[:3, 3] * (1 + share))

    return change


def _tails(share: float, times: float) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        def error(p: FloatArray, k: int, rng: Rng) -> FloatArray:
            many = times if rng.random() < share else 0.0
            shift = many * plan.position_mm * rng.standard_normal(3)
            return pose(p[:3, :3] @ turn(many * plan.orientation_rad * rng.standard_normal(3)), p[:3, 3] + shift)

        plan.pose_error = error

    return change


def _student(freedom: float) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        plan.pose_error = lambda p, k, rng: pose(
            p[:3, :3], p[:3, 3] + plan.position_mm * rng.standard_t(freedom, 3)
        )

    return change


def _lag(mm: float, along: FloatArray | None) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        def error(p: FloatArray, k: int, rng: Rng) -> FloatArray:
            way = rng.standard_normal(3) if along is None else along
            return pose(p[:3, :3], p[:3, 3] + mm * way / np.linalg.norm(way))

        plan.pose_error = error

    return change


def _lag_in_tool(mm: float) -> Callable[[Plan, Rng], None]:
    def change(plan: Plan, rng: Rng) -> None:
        plan.pose_error = lambda p, k, rng: pose(p[:3, :3], p[:3, 3] + p[:3, :3] @ np.array([mm, 0.0, 0.0]))

    return change


def _lag_along_path(mm: float, tilts: int = 11) -> Callable[[Plan, Rng], None]:
    """Short of every pose, on the way from the one before."""

    def change(plan: Plan, rng: Rng) -> None:
        plan.tilts = tilts
        before: list[FloatArray] = []

        def error(p: FloatArray, k: int, rng: Rng) -> FloatArray:
            way = p[:3, 3] - (before[-1] if before else p[:3, 3])
            before.append(p[:3, 3])
            return pose(p[:3, :3], p[:3, 3] - mm * way / max(float(np.linalg.norm(way)), 1e-9))

        plan.pose_error = error

    return change


def _lag_along_flange(mm: float, axis: int) -> Callable[[Plan, Rng], None]:
    """Short of every pose along one axis of the flange, on whichever side the robot came from."""

    def change(plan: Plan, rng: Rng) -> None:
        before: list[FloatArray] = []

        def error(p: FloatArray, k: int, rng: Rng) -> FloatArray:
            way = (p[:3, 3] - (before[-1] if before else p[:3, 3])) @ p[:3, axis]
            before.append(p[:3, 3])
            return pose(p[:3, :3], p[:3, 3] - mm * np.sign(way) * p[:3, axis])

        plan.pose_error = error

    return change


def _wrist(degrees: float) -> Callable[[Plan, Rng], None]:
    """The flange is turned by a constant angle about its axis: the arm's zero of joint 6."""

    def change(plan: Plan, rng: Rng) -> None:
        plan.pose_error = lambda p, k, rng: pose(p[:3, :3] @ turn([0.0, 0.0, np.deg2rad(degrees)]), p[:3, 3])

    return change


TROUBLES = (
    Trouble("clean", lambda plan, rng: None, clean=True),
    Trouble("repeats to 0.01 mm", _random(0.01, 0.002), clean=True),
    Trouble("repeats to 0.1 mm", _random(0.1, 0.01), clean=True),
    Trouble("repeats to 0.2 mm, 0.05°", _random(0.2, 0.05)),
    Trouble("joints 0.005°, links 0.02 mm", _kinematic(0.005, 0.02), clean=True),
    Trouble("joints 0.01°, links 0.05 mm", _kinematic(0.01, 0.05), clean=True),
    Trouble("joints 0.02°, links 0.1 mm", _kinematic(0.02, 0.1), clean=True),
    Trouble("joints 0.05°, links 0.3 mm", _kinematic(0.05, 0.3)),
    Trouble("joints 0.1°, links 0.5 mm", _kinematic(0.1, 0.5)),
    Trouble("gears 0.01°", _kinematic(0.0, 0.0, 0.01)),
    Trouble("gears 0.03°", _kinematic(0.0, 0.0, 0.03)),
    Trouble("sags by 0.02° a metre", _kinematic(0.0, 0.0, 0.0, 0.02)),
    Trouble("sags by 0.1° a metre", _kinematic(0.0, 0.0, 0.0, 0.1)),
    Trouble("joints, gears and sag", _kinematic(0.02, 0.1, 0.01, 0.03)),
    Trouble("poses 0.1 % too long", _scaled(-0.001)),
    Trouble("poses 0.5 % too long", _scaled(-0.005)),
    Trouble("one pose in ten off by 5 sigmas", _tails(0.1, 5.0)),
    Trouble("one pose in five off by 8 sigmas", _tails(0.2, 8.0)),
    Trouble("Student errors of 2 degrees of freedom", _student(2.0)),
    Trouble("lag of 0.2 mm, any direction", _lag(0.2, None)),
    Trouble("lag of 0.3 mm in one direction of base", _lag(0.3, np.array([1.0, 0.0, 0.0]))),
    Trouble("lag of 0.3 mm in one direction of the flange", _lag_in_tool(0.3), hidden=True),
    Trouble("lags by 0.3 mm along its path", _lag_along_path(0.3)),
    Trouble("lags by 0.3 mm along its path, 60 captures", _lag_along_path(0.3, tilts=56)),
    Trouble("lags by 0.3 mm along one axis of its flange", _lag_along_flange(0.3, 0)),
    Trouble("flange turned by 0.1° throughout", _wrist(0.1), hidden=True),
)
