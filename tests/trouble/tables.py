"""Turntables that err: encoders, bearings, axes, spheres that slip, and what people write down of them."""

from collections.abc import Callable

import numpy as np

from calib_core.simulation.motion import pose, turn
from tests.trouble.arms import TROUBLES as ARMS
from tests.trouble.scanner import TROUBLES as SCANNERS
from tests.trouble.table_cell import MOUNTS, TablePlan, TableTrouble

Rng = np.random.Generator
Change = Callable[[TablePlan, Rng], None]
_OF_ARMS = (
    "repeats to 0.1 mm",
    "joints 0.01°, links 0.05 mm",
    "joints, gears and sag",
    "poses 0.5 % too long",
    "one pose in ten off by 5 sigmas",
)
_OF_SCANNERS = (
    "x and z 1 % too long",
    "shear of 1 %",
    "scales and shear as believed",
    "rim of a cheap sensor",
    "points alike over 5 mm",
)


def _set(**values: object) -> Change:
    def change(plan: TablePlan, rng: Rng) -> None:
        for name, value in values.items():
            setattr(plan, name, value)

    return change


def _random_encoder(degrees: float) -> Change:
    return _set(encoder_rad=float(np.deg2rad(degrees)))


def _scaled_encoder(share: float) -> Change:
    def change(plan: TablePlan, rng: Rng) -> None:
        plan.encoder = lambda angle, rng: angle * (1 + share)

    return change


def _eccentric_encoder(degrees: float) -> Change:
    def change(plan: TablePlan, rng: Rng) -> None:
        phase = rng.uniform(0, 2 * np.pi)
        plan.encoder = lambda angle, rng: angle + np.deg2rad(degrees) * np.sin(angle + phase)

    return change


def _backlash(degrees: float) -> Change:
    """Approached from both sides without a rule."""

    def change(plan: TablePlan, rng: Rng) -> None:
        plan.encoder = lambda angle, rng: angle + np.deg2rad(degrees) / 2 * float(rng.choice([-1.0, 1.0]))

    return change


def _wobble(mrad: float, times: int) -> Change:
    def change(plan: TablePlan, rng: Rng) -> None:
        phase = rng.uniform(0, 2 * np.pi)
        plan.wobble = lambda angle: (
            mrad / 1000 * np.array([np.cos(times * angle + phase), np.sin(times * angle + phase), 0.0])
        )

    return change


def _slips(mm: float) -> Change:
    """In the course of the second mounting."""

    def change(plan: TablePlan, rng: Rng) -> None:
        way = rng.standard_normal(3)
        way *= mm / np.linalg.norm(way)
        when = int(rng.integers(10, 14))
        plan.slip = lambda k, mount: way if k >= when else np.zeros(3)

    return change


def _pushed(mm: float) -> Change:
    """Along the floor, while the sphere is mounted the second time."""

    def change(plan: TablePlan, rng: Rng) -> None:
        way = _along_floor(mm, rng)
        plan.table_at = lambda k, mount, count: way if mount else np.zeros(3)

    return change


def _pushed_within(mm: float) -> Change:
    """Along the floor, in the course of a mounting."""

    def change(plan: TablePlan, rng: Rng) -> None:
        way, when = _along_floor(mm, rng), int(rng.choice([3, 4, 5, 11, 12, 13]))
        plan.table_at = lambda k, mount, count: way if k >= when else np.zeros(3)

    return change


def _creeps(mm: float) -> Change:
    """From the first capture to the last."""

    def change(plan: TablePlan, rng: Rng) -> None:
        way = _along_floor(mm, rng)
        plan.table_at = lambda k, mount, count: way * (k / (count - 1))

    return change


def _gives(mm: float) -> Change:
    """What holds the sphere gives, from the first to the last capture of the second mounting."""

    def change(plan: TablePlan, rng: Rng) -> None:
        way = rng.standard_normal(3)
        way *= mm / np.linalg.norm(way)
        plan.slip = lambda k, mount: way * ((k - 8) / 7) if mount else np.zeros(3)

    return change


def _along_floor(mm: float, rng: Rng) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return mm * np.array([np.cos(angle), np.sin(angle), 0.0])


def _tool_moves(mm: float, degrees: float) -> Change:
    """Between the captures beside the table and those on it."""

    def change(plan: TablePlan, rng: Rng) -> None:
        way, axis = rng.standard_normal(3), rng.standard_normal(3)
        moved = pose(turn(np.deg2rad(degrees) * axis / np.linalg.norm(axis)), mm * way / np.linalg.norm(way))
        plan.mounting = lambda k: moved if k >= plan.shifts + plan.tilts else np.eye(4)

    return change


def _rounds(angles: list[float], mounts: list[str], rng: Rng) -> None:
    angles[:] = [round(a + rng.uniform(-0.05, 0.05), 1) for a in angles]


def _one_wrong(angles: list[float], mounts: list[str], rng: Rng) -> None:
    angles[int(rng.integers(len(angles)))] += 10.0


def _swaps(angles: list[float], mounts: list[str], rng: Rng) -> None:
    i, j = rng.choice(8, 2, replace=False)
    angles[i], angles[j] = angles[j], angles[i]


def _shifted_by_one(angles: list[float], mounts: list[str], rng: Rng) -> None:
    angles[3:8] = angles[4:8] + angles[3:4]


def _mislabelled(angles: list[float], mounts: list[str], rng: Rng) -> None:
    mounts[8] = mounts[9] = MOUNTS[0]


def _other_way(angles: list[float], mounts: list[str], rng: Rng) -> None:
    angles[:] = [-a for a in angles]


def _as_of(name: str, change: Callable[..., None]) -> TableTrouble:
    return TableTrouble(name, change, clean=name in ("repeats to 0.1 mm", "joints 0.01°, links 0.05 mm"))


TABLE_TROUBLES = (
    TableTrouble("clean", lambda plan, rng: None, clean=True),
    TableTrouble("encoder of 0.01°", _random_encoder(0.01), clean=True),
    TableTrouble("encoder of 0.05°", _random_encoder(0.05)),
    TableTrouble("encoder counts 0.1 % too little", _scaled_encoder(0.001)),
    TableTrouble("encoder counts 0.5 % too little", _scaled_encoder(0.005)),
    TableTrouble("encoder eccentric by 0.02°", _eccentric_encoder(0.02)),
    TableTrouble("encoder eccentric by 0.1°", _eccentric_encoder(0.1)),
    TableTrouble("backlash of 0.05°", _backlash(0.05)),
    TableTrouble("play of 0.02 mm", _set(play_mm=0.02), clean=True),
    TableTrouble("play of 0.1 mm", _set(play_mm=0.1)),
    TableTrouble("wobbles by 0.2 mrad twice a turn", _wobble(0.2, 2)),
    TableTrouble("wobbles by 1 mrad twice a turn", _wobble(1.0, 2)),
    TableTrouble("wobbles by 1 mrad three times a turn", _wobble(1.0, 3)),
    TableTrouble("sphere slips by 0.5 mm", _slips(0.5)),
    TableTrouble("sphere slips by 3 mm", _slips(3.0)),
    TableTrouble("pushed by 1 mm between the mountings", _pushed(1.0)),
    TableTrouble("pushed by 0.3 mm between the mountings", _pushed(0.3)),
    TableTrouble("pushed by 1 mm within a mounting", _pushed_within(1.0)),
    TableTrouble("creeps by 0.3 mm", _creeps(0.3)),
    TableTrouble("a clamp gives by 0.5 mm", _gives(0.5)),
    TableTrouble("another sphere, 0.2 mm larger, on the table", _set(table_radius_mm=20.1)),
    TableTrouble("tool moves by 0.3 mm before the table", _tool_moves(0.3, 0.0), hidden_from=("fixed",)),
    TableTrouble("tool moves by 1 mm, 0.3° before the table", _tool_moves(1.0, 0.3), hidden_from=("fixed",)),
    TableTrouble("angles of one decimal", _set(read=_rounds)),
    TableTrouble("an angle is 10° off", _set(read=_one_wrong)),
    TableTrouble("two angles swapped", _set(read=_swaps)),
    TableTrouble("angles shifted by one", _set(read=_shifted_by_one)),
    TableTrouble("two captures of the other mounting", _set(read=_mislabelled)),
    TableTrouble("angles count the other way", _set(read=_other_way, told_table={"direction": 1})),
    TableTrouble("one height", _set(heights_mm=(0.0,))),
    TableTrouble("heights 15 mm apart", _set(heights_mm=(0.0, 15.0))),
    TableTrouble("less than half a turn", _set(angles_deg=(0.0, 17.0, 40.0, 75.0, 110.0, 130.0, 155.0))),
    TableTrouble("15 mm off the axis", _set(arm_mm=15.0)),
    *(_as_of(t.name, t.change) for t in ARMS if t.name in _OF_ARMS),
    *(_as_of(t.name, t.change) for t in SCANNERS if t.name in _OF_SCANNERS),
)
