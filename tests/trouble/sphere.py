"""Spheres that are not what they are told to be, or not where they were."""

from collections.abc import Callable

import numpy as np

from calib_core.simulation.motion import FloatArray
from tests.trouble.cell import Plan, Trouble

Rng = np.random.Generator
Change = Callable[[Plan, Rng], None]
Background = Callable[[FloatArray, FloatArray, float, Rng], FloatArray]


def _told(off_mm: float, sigma_mm: float | None = None) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.told_diameter_mm, plan.told_diameter_sigma_mm = 2 * plan.radius_mm + off_mm, sigma_mm

    return change


def _moves(mm: float, one_capture: bool = False) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        way = rng.standard_normal(3)
        way *= mm / np.linalg.norm(way)
        when = int(rng.integers(6, 12))
        last = when if one_capture else 1000
        plan.sphere_at = lambda k, n: way if when <= k <= last else np.zeros(3)

    return change


def _drifts(mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        way = rng.standard_normal(3)
        way *= mm / np.linalg.norm(way)
        plan.sphere_at = lambda k, n: way * k / (n - 1)

    return change


def _shakes(mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        places = mm * rng.standard_normal((100, 3))
        plan.sphere_at = lambda k, n: places[k]

    return change


def _out_of_round(mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        def off(angle: FloatArray, rng: Rng) -> FloatArray:
            phase = rng.uniform(0, 2 * np.pi)
            return mm * np.sin(3 * angle + phase)

        plan.surface = off

    return change


def _size(radius_mm: float, point_mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.radius_mm, plan.point_mm = radius_mm, point_mm

    return change


def _stem_and_table(points: FloatArray, center: FloatArray, circle: float, rng: Rng) -> FloatArray:
    x = np.arange(-60.0, 60.0, 0.1)
    z = np.where(x < 25.0, center[2] + 110.0 + 0.2 * x, np.nan)
    stem = np.abs(x - center[0] - 3.0) < 5.0
    z[stem] = center[2] + 25.0
    z += 0.02 * rng.standard_normal(len(x))
    hidden = np.abs(x - center[0]) < 1.02 * circle
    return np.concatenate([points, np.column_stack([x, z])[~hidden]])


def _second_sphere(points: FloatArray, center: FloatArray, circle: float, rng: Rng) -> FloatArray:
    middle, radius = np.array([center[0] + 55.0, center[2] + 8.0]), 0.9 * circle
    angle = np.linspace(-1.0, 1.0, 200)
    far = radius + 0.02 * rng.standard_normal(200)
    other = middle + np.column_stack([np.sin(angle) * far, -np.cos(angle) * far])
    return np.concatenate([points, other])


def _clamp(points: FloatArray, center: FloatArray, circle: float, rng: Rng) -> FloatArray:
    """A ring about the sphere covers a part of it and looks round itself."""
    angle = np.arctan2(points[:, 0] - center[0], center[2] - points[:, 1])
    covered = (angle > 0.25) & (angle < 0.6)
    moved = points.copy()
    moved[covered, 1] -= 1.5
    return moved


def _seen(background: Background) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.background = background

    return change


TROUBLES = (
    Trouble("stem and table in view", _seen(_stem_and_table), clean=True),
    Trouble("a second sphere in view", _seen(_second_sphere)),
    Trouble("a clamp on the sphere", _seen(_clamp)),
    Trouble("told 0.02 mm too large", _told(0.02)),
    Trouble("told 0.1 mm too large", _told(0.1)),
    Trouble("told 0.3 mm too small", _told(-0.3)),
    Trouble("told with 0.1 mm of sigma", _told(0.05, 0.1)),
    Trouble("certified", _told(0.0, 0.002), clean=True),
    Trouble("moved by 0.2 mm for good", _moves(0.2)),
    Trouble("moved by 0.5 mm for good", _moves(0.5)),
    Trouble("moved by 1 mm for good", _moves(1.0)),
    Trouble("moved by 5 mm for good", _moves(5.0)),
    Trouble("moved by 0.5 mm in one capture", _moves(0.5, one_capture=True)),
    Trouble("moved by 3 mm in one capture", _moves(3.0, one_capture=True)),
    Trouble("drifts by 0.1 mm", _drifts(0.1), clean=True),
    Trouble("drifts by 0.3 mm", _drifts(0.3), clean=True),
    Trouble("shakes by 0.1 mm", _shakes(0.1)),
    Trouble("out of round by 0.01 mm", _out_of_round(0.01)),
    Trouble("80 mm wide", _size(40.0, 0.02), clean=True),
    Trouble("25 mm wide, noise of 0.08 mm", _size(12.7, 0.08)),
)
