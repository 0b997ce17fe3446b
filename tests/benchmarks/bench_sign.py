"""Verifications that one may sign: decisions near, under and over the limit, and one wrong pose among fourteen."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from bench_verify import POSITION_MM, SPHERE, TURNING_RAD, observations_of
from harness import Row

from calib_core.chain.observations import SphereObservation
from calib_core.frames import RigidTransform
from calib_core.stages.verify.agreement import disagreeing
from calib_core.stages.verify.decision import decided, tool_error
from calib_core.stages.verify.held_out import Asked, held_out
from calib_core.stages.verify.tool import Tool

_SHARES = (0.0, 0.5, 0.8, 0.95, 1.05, 1.2, 1.5, 2.0)
_LIMITS_MM = (0.2, 0.4, 0.8, 0.05)
_NAMED = {0.5: 0.8, 1.0: 0.95, 5.0: 0.99}
_OFF_MM = (0.5, 1.0, 5.0)
_CAPTURES = 14


def run(full: bool) -> list[Row]:
    """Return the figures over 400 verifications and 300 right ones in full, a tenth of them otherwise."""
    if not full:
        return [*decisions(40), *wrong_poses(_OFF_MM[1:], 10, 30)]
    return [*decisions(400), *wrong_poses(_OFF_MM, 50, 300)]


def decisions(count: int) -> list[Row]:
    """Return how often the rule passes what is beyond its limit, and fails what is within."""
    found: Counter[str] = Counter()
    beyond = within = wide = open_ = 0
    for seed in range(count):
        share = _SHARES[seed % len(_SHARES)]
        limit_mm = _LIMITS_MM[seed // len(_SHARES) % len(_LIMITS_MM)]
        _, tool, asked = verification(seed, share * limit_mm)
        estimate = tool_error(asked, tool)
        decision = decided(estimate.value_mm, estimate.uncertainty_mm, limit_mm)
        beyond, within = beyond + (share > 1), within + (share <= 1)
        found["false pass"] += decision == "pass" and share > 1
        found["false fail"] += decision == "fail" and share <= 1
        wide += estimate.uncertainty_mm > limit_mm
        open_ += estimate.uncertainty_mm > limit_mm and decision == "undecided"
    passed, failed = found["false pass"] / max(beyond, 1), found["false fail"] / max(within, 1)
    return [
        Row(f"{beyond} verifications beyond the limit: pass", "≤ 2.5 %", f"{passed:.1%}", passed <= 0.025),
        Row(f"{within} verifications within the limit: fail", "≤ 2.5 %", f"{failed:.1%}", failed <= 0.025),
        Row("U above the limit: undecided", "always", f"{open_} of {wide}", open_ == wide),
    ]


def wrong_poses(off: Sequence[float], count: int, right: int) -> list[Row]:
    """Return how often the one wrong capture is named, and how often a right set has one named."""
    rows: list[Row] = []
    for off_mm in off:
        target, named = _NAMED[off_mm], 0
        for seed in range(count):
            observations, tool, _ = verification(1000 + seed, 0.0)
            rng = np.random.default_rng([seed, 45])
            wrong = int(rng.integers(len(observations)))
            way = rng.normal(size=3)
            observations[wrong] = moved(observations[wrong], off_mm * way / np.linalg.norm(way))
            now = held_out(observations, SPHERE, tool).asked
            named += observations[wrong].capture in disagreeing(observations, SPHERE.radius_mm, now)
        share = named / count
        what = f"{count} verifications, one pose of {_CAPTURES} wrong by {off_mm:g} mm: named"
        rows.append(Row(what, f"≥ {target:.0%}", f"{share:.0%}", share >= target))
    falsely = 0
    for seed in range(right):
        observations, tool, asked = verification(5000 + seed, 0.3)
        falsely += bool(disagreeing(observations, SPHERE.radius_mm, asked))
    share = falsely / right
    what = f"{right} right ones, the tool off by 0.3 mm: a capture named"
    return [*rows, Row(what, "≤ 0.5 %", f"{share:.2%}", share <= 0.005)]


def verification(seed: int, off_mm: float) -> tuple[list[SphereObservation], Tool, Asked]:
    """Return a verification of a tool that is off by so much: captures, tool, and the one that they ask for."""
    rng = np.random.default_rng([seed, 2611])
    truth, observations = observations_of(rng, _CAPTURES, turned_rad=1.0)
    direction = rng.normal(size=3)
    shift = off_mm * direction / np.linalg.norm(direction)
    given = RigidTransform.of(truth.rotation, truth.translation_mm + shift, "tool0", "laser")
    tool = Tool(given, np.zeros((6, 6)), POSITION_MM, TURNING_RAD)
    return observations, tool, held_out(observations, SPHERE, tool).asked


def moved(observation: SphereObservation, by_mm: np.ndarray) -> SphereObservation:
    """Return a capture whose flange is told elsewhere by so much, along base's axes."""
    told = observation.base_from_tool0
    elsewhere = RigidTransform.of(told.rotation, told.translation_mm + by_mm, "base", "tool0")
    return replace(observation, base_from_tool0=elsewhere)
