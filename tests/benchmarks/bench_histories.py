"""Histories of 60 sessions of a cell: creep, steps, nothing at all.

Of poses that vary the errors are drawn from solved covariances, those of the scanner once for each history. Of one
program they are drawn as nights scatter that were simulated and solved: at the same poses the arm errs alike, but
for a third, and all noise is new.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from bench_drift import measured, moved, off_by, point_of, session_point
from cells import GIVEN, SPHERE, Cell
from harness import Row, kept

from calib_core.captures.observe import observe_capture
from calib_core.chain.tcp import solve_tcp
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture
from calib_core.review.between_sessions import Measured
from calib_core.review.drift import FALSE_ALARM, charted
from calib_core.review.drift_trend import trend_of
from calib_core.simulation.motion import pose, turn
from calib_core.simulation.profile_cell import shot_from
from calib_core.simulation.writing import shot_files, shot_record
from calib_core.stages.pipeline import stage_input
from calib_core.stages.tcp.solve import solve_tcp_captures
from tests.trouble import Trouble, troubled

_LONG, _STEP_AT, _FOUND_BEFORE_MM, _FIRST_FRESH = 60, 20, 0.3, 400
_NEW_EACH_NIGHT = 1 / 3
_PAPERS = "the paper's arm"
Draw = Callable[[list[int], float], list[Measured]]
"""A history by its seed, creeping by so many mm a session."""


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 200 histories of the target."""
    kinds = [session_point(seed) for seed in range(6)]
    count = 200 if full else 80
    programs = [_nights(seed, 24 if full else 12) for seed in range(4 if full else 2)]
    return [
        *histories(count, varying(kinds), f"{_PAPERS}, poses that vary"),
        *best_possible(kinds, f"{_PAPERS}, poses that vary"),
        *histories(count, of_a_program(programs), f"{_PAPERS}, the same poses each night"),
        *as_solved(programs, f"{len(programs)} cells of {len(programs[0])} nights solved at the same poses"),
        *as_solved(*_of_one_scanner(24 if full else 8)),
    ]


def histories(count: int, draw: Draw, arm: str) -> list[Row]:
    """Return what is told of long histories: cells that creep, that make a step, and that stay as they are.

    Their seeds are none of those that the limits were chosen on.
    """
    told = [kept(f"histories {arm} {number}", lambda n=number: _told(draw, n)) for number in _fresh(count)]
    steps, trends = (sum(one[what] for one in told) for what in ("step", "trend"))
    rows = [
        Row(f"{arm}, {count} quiet histories of {_LONG}: false steps", "≤ 2.5 %", f"{steps} of {count}",
            steps <= 0.025 * count),
        Row(f"{arm}, the same: false trends", "≤ 20 %", f"{trends / count:.1%}", trends <= 0.2 * count),
    ]  # fmt: skip
    for creep_mm in (0.01, 0.03):
        found = sum(one[f"creep {creep_mm:g}"] for one in told)
        what = f"{arm}, creeping {creep_mm:g} mm a session: found before {_FOUND_BEFORE_MM:g} mm"
        rows.append(Row(what, "≥ 90 %", f"{found / count:.1%}", found >= 0.9 * count))
    for step_mm in (0.3, 1.0):
        found = sum(one[f"step {step_mm:g}"] for one in told)
        what = f"{arm}, a step of {step_mm:g} mm: found at once"
        rows.append(Row(what, "≥ 95 %", f"{found / count:.1%}", found >= 0.95 * count))
    return rows


def _fresh(count: int) -> range:
    return range(_FIRST_FRESH, _FIRST_FRESH + count)


def _told(draw: Draw, number: int) -> dict[str, bool]:
    """Return what is told of one quiet history, of the same with a step, and of others that creep."""
    quiet = draw([number, 63], 0.0)
    told = {
        "step": any(bool(row.flagged) for row in charted(quiet)),
        "trend": _trend_begins(quiet) is not None,
        **{f"step {mm:g}": _finds_step(quiet, mm, number) for mm in (0.3, 1.0)},
    }
    for creep_mm in (0.01, 0.03):
        begins = _trend_begins(draw([number, 64], creep_mm))
        told[f"creep {creep_mm:g}"] = begins is not None and begins * creep_mm < _FOUND_BEFORE_MM
    return told


def as_solved(cells: list[list[Measured]], what: str) -> list[Row]:
    """Return what is told of sessions that were solved, in their order: nothing happened in them."""
    last = len(cells[0]) - 1
    steps = sum(any(row.flagged for row in charted(sessions)) for sessions in cells)
    found = sum(_finds_step(sessions, 0.3, n, last) for n, sessions in enumerate(cells))
    return [
        Row(f"{what}: false steps", "0", f"{steps}", steps == 0),
        Row(f"{what}: a step of 0.3 mm found at once", "", f"{found}", None),
    ]


def _of_one_scanner(count: int) -> tuple[list[list[Measured]], str]:
    """Return sessions of a scanner that errs as is believed of scanners, each at other poses."""

    def scanner(points: FloatArray, _: np.random.Generator) -> FloatArray:
        x, z = points.T
        return np.column_stack([x * 1.004 + 0.006 * z, z * 0.996])

    trouble = Trouble("a scanner that errs", lambda plan, _: setattr(plan, "scanner", scanner))
    found: list[Measured] = []
    for seed in range(count):
        cell = troubled(trouble, seed, told=True)
        given = stage_input(cell.session, "tcp", cell.files.__getitem__)
        solution = solve_tcp_captures(given).solution
        found.append(off_by(RigidTransform(cell.tool0_from_laser, "tool0", "laser"), solution))
    return [found], f"{count} sessions solved, each at other poses, of a scanner that errs by 0.4 %"


def varying(kinds: list[Measured]) -> Draw:
    """Return how histories are drawn whose poses are others each time: only the scanner's errors are shared."""
    return lambda seed, creep_mm: _history(kinds, seed, creep_mm)


def of_a_program(programs: list[list[Measured]]) -> Draw:
    """Return how histories of one program are drawn: they scatter as its solved nights do."""

    def draw(seed: list[int], creep_mm: float) -> list[Measured]:
        rng = np.random.default_rng(seed)
        nights = programs[rng.integers(len(programs))]
        scatter = np.cov(np.array([one.value for one in nights]).T)
        way = rng.normal(size=3)
        way *= creep_mm / np.linalg.norm(way)
        picked = [nights[rng.integers(len(nights))] for _ in range(_LONG)]
        return [
            measured(rng.multivariate_normal(k * way, scatter), one.covariance, one.session.program)
            for k, one in enumerate(picked)
        ]

    return draw


def _nights(seed: int, count: int) -> list[Measured]:
    """Return nights of one cell: the same poses, ball and arm, whose errors stay but for a share."""
    cell = Cell.of("tcp", seed)
    world = cell.simulated.world
    assert world is not None
    stay = np.sqrt(1 - _NEW_EACH_NIGHT**2) * np.random.default_rng([seed, 70]).normal(size=(len(world.shots), 6))
    sigmas = np.repeat([world.options.orientation_sigma_rad, world.options.position_sigma_mm], 3)
    program = np.array([shot.commanded for shot in world.shots])
    found: list[Measured] = []
    for night in range(count):
        rng = np.random.default_rng([seed, night, 71])
        seen = []
        for shot, error in zip(
            world.shots, (stay + _NEW_EACH_NIGHT * rng.normal(size=stay.shape)) * sigmas, strict=True
        ):
            rotation, place = shot.commanded[:3, :3] @ turn(error[:3]), shot.commanded[:3, 3] + error[3:]
            center = world.sphere_center_in_base_mm
            again = shot_from(world, shot.name, shot.kind, shot.commanded, pose(rotation, place), center, rng)
            capture, files = Capture.model_validate(shot_record(again, world)), shot_files(again, world)
            seen.append(observe_capture(cell.simulated.session, capture, files.__getitem__))
        told = point_of(cell, solve_tcp(seen, SPHERE, GIVEN))
        found.append(replace(told, session=replace(told.session, program=program)))
    return found


def best_possible(kinds: list[Measured], arm: str, step_mm: float = 0.3) -> list[Row]:
    """Return how often any test finds a step at once, at the same false alarms: what is left to chance, exactly.

    The scanner's errors are known to it, and so are the answers' covariances: what remains are the errors of poses
    and points, new in each session.  By Neyman and Pearson none finds more where the way of the step is known,
    and by symmetry none where it may be any.
    """
    from scipy.stats import chi2, ncx2, norm

    ways = np.random.default_rng(66).normal(size=(2000, 3))
    ways *= step_mm / np.linalg.norm(ways, axis=1)[:, None]
    own = np.array([one.common.own for one in kinds if one.common is not None])
    before = np.linalg.inv(_STEP_AT * np.linalg.inv(own).mean(axis=0))
    squared = np.einsum("wi,kij,wj->kw", ways, np.linalg.inv(own + before), ways)
    along = norm.sf(norm.isf(FALSE_ALARM) - np.sqrt(squared)).mean()
    any_way, twice = (ncx2.sf(chi2.isf(FALSE_ALARM, 3), 3, k * squared).mean() for k in (1, 2))
    what = f"{arm}, a step of {step_mm:g} mm at once: any test's most"
    return [
        Row(f"{what}, way and scanner known", "", f"{along:.1%}", None),
        Row(f"{what}, any way", "", f"{any_way:.1%}; twice the captures {twice:.1%}", None),
    ]


def _history(kinds: list[Measured], seed: list[int], creep_mm: float = 0.0) -> list[Measured]:
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    way *= creep_mm / np.linalg.norm(way)
    beliefs = [one.common.belief for one in kinds if one.common is not None]
    errors = rng.multivariate_normal(np.zeros(len(beliefs[0])), np.mean(beliefs, axis=0)) if beliefs else None
    picked = [kinds[rng.integers(len(kinds))] for _ in range(_LONG)]
    return [_drawn(one, k * way, errors, rng) for k, one in enumerate(picked)]


def _drawn(one: Measured, place: FloatArray, errors: FloatArray | None, rng: np.random.Generator) -> Measured:
    if one.common is None or errors is None:
        return measured(rng.multivariate_normal(place, one.covariance), one.covariance)
    value = rng.multivariate_normal(place + one.common.by @ errors, one.common.own)
    return replace(one, value=value, common=replace(one.common, value=value))


def _trend_begins(history: list[Measured]) -> int | None:
    """Return the session with which a trend is told for the first time."""
    for at in range(len(history)):
        trend = trend_of(history[: at + 1])
        if trend is not None and trend.found:
            return at
    return None


def _finds_step(history: list[Measured], step_mm: float, seed: int, at: int = _STEP_AT) -> bool:
    way = np.random.default_rng([seed, 65]).normal(size=3)
    way *= step_mm / np.linalg.norm(way)
    return bool(charted([*history[:at], moved(history[at], way)])[at].flagged)
