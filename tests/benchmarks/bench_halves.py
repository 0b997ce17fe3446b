"""Random halves of both real sets: do they differ as they say, and does the diameter's sigma move the tool?"""

import json
from functools import cache
from pathlib import Path

import numpy as np
from harness import Row

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.tcp import TcpSolution, solve_tcp
from calib_core.frames import FloatArray
from calib_core.records import parse_session

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SETS = ("tcp-sphere-80mm", "tcp-sphere-25mm")
_CHI2_6_95 = 12.6


def run(full: bool) -> list[Row]:
    """Return the rows; `full` takes the twelve halves of the target, otherwise four."""
    if not DATA.is_dir():
        return [Row("real sets beside the project (../shared/data)", "", "not there")]
    return [row for name in SETS for row in (*halves(name, 12 if full else 4), diameter(name))]


@cache
def measured(name: str) -> tuple[list[SphereObservation], SphereSize]:
    folder = DATA / name
    session = parse_session(json.loads((folder / "session.json").read_text(encoding="utf-8")))
    read = lambda file: (folder / file).read_bytes()  # noqa: E731
    return [observe_capture(session, c, read) for c in session.captures], sphere_of(session.cell, session.captures)


def halves(name: str, count: int) -> list[Row]:
    observations, sphere = measured(name)
    rng = np.random.default_rng(2026)
    squares: list[float] = []
    ratios: list[FloatArray] = []
    while len(squares) < count:
        order = rng.permutation(len(observations))
        some = np.zeros(len(observations), dtype=bool)
        some[order[: len(order) // 2]] = True
        pair = [_solved(observations, sphere, mask) for mask in (some, ~some)]
        tools = [s.joint.tool0_from_laser for s in pair]
        off = tools[0].difference(tools[1])
        covariance = pair[0].covariance[:6, :6] + pair[1].covariance[:6, :6]
        squares.append(float(off @ np.linalg.solve(covariance, off)))
        ratios.append(off**2 / np.diag(covariance))
    spread = 1 / np.sqrt(np.mean(ratios, axis=0))
    middle, beyond = float(np.median(squares)), float(np.mean(np.array(squares) > _CHI2_6_95))
    text = " ".join(f"{r:.2f}" for r in spread)
    true = bool(spread.min() > 0.7 and spread.max() < 2)
    return [
        Row(f"{name}: {count} halves, χ² of their difference (6), median", "≤ 8", f"{middle:.2f}", middle <= 8),
        Row(f"{name}: above {_CHI2_6_95}", "≤ 10 %", f"{beyond:.0%}", beyond <= 0.1),
        Row(
            f"{name}: stated / observed spread, rx … tz",
            "0.7 … 2",
            text,
            true,
        ),
    ]


def _solved(observations: list[SphereObservation], sphere: SphereSize, some: np.ndarray) -> TcpSolution:
    return solve_tcp([o for o, good in zip(observations, some, strict=True) if good], sphere)


def diameter(name: str) -> Row:
    """By how many stated sigmas the tool moves as the diameter's sigma is told to be 0, 0.02, 0.05 and 0.1 mm."""
    observations, sphere = measured(name)
    solutions = [solve_tcp(observations, SphereSize(sphere.diameter_mm, s)) for s in (0.0, 0.02, 0.05, 0.1)]
    most = 0.0
    for one in solutions:
        for other in solutions:
            off = one.joint.tool0_from_laser.difference(other.joint.tool0_from_laser)
            most = max(most, float(np.abs(off / np.sqrt(np.diag(other.covariance)[:6])).max()))
    return Row(f"{name}: tool moves with the diameter's sigma", "≤ 0.3 sigmas", f"{most:.2f}", most <= 0.3)
