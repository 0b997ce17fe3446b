"""Scanners that err: scales, shear, bow, lens, light at the rim, noise of all kinds."""

from collections.abc import Callable

import numpy as np

from calib_core.simulation.motion import FloatArray
from tests.trouble.cell import Plan, Trouble

Rng = np.random.Generator
Change = Callable[[Plan, Rng], None]


def _linear(x: float = 0.0, z: float = 0.0, shear: float = 0.0, drawn: bool = False) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        by = rng.standard_normal(3) if drawn else np.ones(3)
        a, b, c = by * [x, z, shear]
        plan.scanner = lambda p, rng: np.column_stack([p[:, 0] * (1 + a) + c * p[:, 1], p[:, 1] * (1 + b)])

    return change


def _bow(mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.scanner = lambda p, rng: np.column_stack([p[:, 0], p[:, 1] + mm * (p[:, 0] / 40.0) ** 2])

    return change


def _lens(mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        a, b, c = rng.uniform(0, 2 * np.pi, 3)

        def bent(p: FloatArray, rng: Rng) -> FloatArray:
            x, z = p.T
            wave = np.sin(x / 25.0 + a) * np.sin(z / 60.0 + b)
            return np.column_stack([x + mm * np.sin(x / 20.0 + c) / 2, z + mm * wave])

        plan.scanner = bent

    return change


def _rim(edge_mm: float, middle_mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.arc_deg = 75.0

        def off(angle: FloatArray, rng: Rng) -> FloatArray:
            degrees = np.rad2deg(angle)
            return np.interp(degrees, [0.0, 40.0, 50.0, 75.0, 90.0], [0.0, 0.0, middle_mm, edge_mm, edge_mm])

        plan.surface = off

    return change


def _rim_cheap(plan: Plan, rng: Rng) -> None:
    plan.arc_deg = 75.0
    plan.surface = lambda angle, rng: np.interp(np.rad2deg(angle), [0, 45, 75, 90], [0.035, -0.05, 0.085, 0.09])


def _correlated(length: int, share: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        def noise(n: int, rng: Rng) -> FloatArray:
            raw = rng.standard_normal(n + 6 * length)
            kernel = np.exp(-0.5 * (np.arange(-3 * length, 3 * length + 1) / length) ** 2)
            smooth = np.convolve(raw, kernel / np.sqrt((kernel**2).sum()), "valid")[:n]
            return np.sqrt(share) * smooth + np.sqrt(1 - share) * rng.standard_normal(n)

        plan.noise = noise

    return change


def _noise(of: Callable[[int, Rng], FloatArray]) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.noise = of

    return change


def _quantised(step_mm: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        plan.point_mm = 0.005
        plan.scanner = lambda p, rng: np.column_stack([p[:, 0], np.round(p[:, 1] / step_mm) * step_mm])

    return change


def _speckled(n: int, rng: Rng) -> FloatArray:
    return rng.standard_normal(n) * np.where(rng.random(n) < 0.05, 6.0, 1.0)


def _toward(plan: Plan, rng: Rng) -> None:
    plan.scanner = lambda p, rng: np.column_stack([p[:, 0], 400.0 - p[:, 1]])
    plan.laser_from_files = np.diag([1.0, -1.0, -1.0, 1.0])  # right-handed: y turns as well
    plan.laser_from_files[2, 3] = 400.0


def _set(**values: float) -> Change:
    def change(plan: Plan, rng: Rng) -> None:
        for name, value in values.items():
            setattr(plan, name, value)

    return change


def _bent_sheet(mm: float) -> Change:
    """At 40 mm from its middle, the sphere seen all over the stripe."""

    def change(plan: Plan, rng: Rng) -> None:
        plan.tilts, plan.lateral_mm = 56, 40.0
        plan.sheet = lambda x: mm * (x / 40.0) ** 2

    return change


TROUBLES = (
    Trouble("x 0.5 % too long", _linear(x=0.005)),
    Trouble("x 1 % too long", _linear(x=0.01)),
    Trouble("z 0.5 % too long", _linear(z=0.005)),
    Trouble("z 1 % too long", _linear(z=0.01)),
    Trouble("x and z 0.5 % too long", _linear(x=0.005, z=0.005)),
    Trouble("x and z 1 % too long", _linear(x=0.01, z=0.01)),
    Trouble("shear of 1 %", _linear(shear=0.01)),
    Trouble("shear of 2 %", _linear(shear=0.02)),
    Trouble("scales and shear as believed", _linear(0.005, 0.005, 0.01, drawn=True)),
    Trouble("bow of 0.05 mm", _bow(0.05)),
    Trouble("bow of 0.2 mm", _bow(0.2)),
    Trouble("lens of 0.02 mm", _lens(0.02)),
    Trouble("lens of 0.1 mm", _lens(0.1)),
    Trouble("rim of a good sensor", _rim(0.045, -0.015)),
    Trouble("rim of a cheap sensor", _rim_cheap),
    Trouble("points alike over 1 mm", _correlated(10, 0.8)),
    Trouble("points alike over 5 mm", _correlated(50, 0.5)),
    Trouble("speckle: one point in twenty six times as noisy", _noise(_speckled)),
    Trouble("Student noise of 3 degrees of freedom", _noise(lambda n, rng: rng.standard_t(3.0, n))),
    Trouble("z in steps of 0.05 mm", _quantised(0.05)),
    Trouble("noise of 0.1 mm", _set(point_mm=0.1)),
    Trouble("z counts towards the scanner", _toward, clean=True),
    Trouble("sheet of light bent by 0.4 mm, 60 captures", _bent_sheet(0.4)),
    Trouble("arcs of ±35°", _set(arc_deg=35.0)),
    Trouble("coarse columns of 0.5 mm", _set(pitch_mm=0.5), clean=True),
    Trouble("fine columns of 0.02 mm", _set(pitch_mm=0.02), clean=True),
)
