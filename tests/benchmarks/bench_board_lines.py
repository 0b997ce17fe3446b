"""Lines on boards as workshops have them: how many are used, whether the ± holds, and boards without a laser."""

from typing import Any

import numpy as np
from harness import Row, kept

from calib_core.errors import CalibrationError
from calib_core.stages.laser_plane.solve import LaserPlaneResult
from calib_core.stages.pipeline import solve_stage
from tests.stripe_sets import DARK_KINDS, KINDS, StripeSet, stripe_set

_UNSEEN = "chessboard"  # in the reason of a frame whose board was not found: that is not the line's
_BOARDS = 12
_OFF = frozenset(number for number in range(_BOARDS) if number % 3)


def run(full: bool) -> list[Row]:
    """Return the rows; `full` takes twenty sets of each kind and 2,000 frames without laser, otherwise few."""
    seeds = range(20 if full else 1)
    solved = [
        kept(f"line-{kind}-{100 + seed}", lambda k=kind, s=seed: _told(k, 100 + s))
        for kind in KINDS
        for seed in seeds
    ]
    refused = sum(one is None for one in solved)
    sets_told = [one for one in solved if one is not None]
    used, seen = sum(one["used"] for one in sets_told), sum(one["seen"] for one in sets_told)
    ratios = [one["ratio"] for one in sets_told]
    false_passes = sum(one["verdict"] == "pass" and one["ratio"] > 3 for one in sets_told)
    rms = float(np.sqrt(np.mean(np.square(ratios))))
    sets = f"{len(KINDS)} kinds × {len(seeds)}"
    taken, frames = _taken_without_laser(range(42 if full else 1))
    return [
        Row(
            f"lines used of boards found, {sets}",
            "≥ 90 %",
            f"{used} of {seen}; sets refused: {refused}",
            used >= 0.9 * seen,
        ),
        Row("plane's error / stated, root mean square", "0.7–1.3", f"{rms:.2f}", 0.7 <= rms <= 1.3),
        Row("`pass` beyond 3 stated", "0", str(false_passes), false_passes == 0),
        Row(
            "boards without the laser that take a line",
            "≤ 1 in 1,000",
            f"{taken} of {frames}",
            taken <= frames / 1000,
        ),
    ]


def _taken_without_laser(seeds: range) -> tuple[int, int]:
    sets = [(kind, 200 + seed) for seed in seeds for kind in DARK_KINDS]
    taken = sum(kept(f"dark-{kind}-{seed}", lambda k=kind, s=seed: _taken(k, s)) for kind, seed in sets)
    return taken, len(sets) * len(_OFF)


def _taken(kind: str, seed: int) -> int:
    """Return how many boards of a set on which the laser is off take a line."""
    result = _solved(stripe_set(kind, seed, _BOARDS, _OFF))
    rows = [] if result is None else result.residuals
    return sum(row.used for row in rows if int(row.capture[1:]) - 1 in _OFF)


def _told(kind: str, seed: int) -> dict[str, Any] | None:
    """Return what counts of a set's answer, None where it is refused."""
    one = stripe_set(kind, seed)
    result = _solved(one)
    if result is None:
        return None
    lines = [row for row in result.residuals if _UNSEEN not in (row.reason or "")]
    used = sum(row.used for row in lines)
    return {"used": used, "seen": len(lines), "ratio": _ratio(one, result), "verdict": result.verdict}


def _solved(one: StripeSet) -> LaserPlaneResult | None:
    try:
        result = solve_stage(one.session, "laser-plane", one.files.__getitem__)
    except CalibrationError:
        return None
    assert isinstance(result, LaserPlaneResult)
    return result


def _ratio(one: StripeSet, result: LaserPlaneResult) -> float:
    plane = result.plane_in_camera
    off = np.array(plane.normal) - one.cell.sheet.normal
    error = np.array([*off, plane.distance_mm - one.cell.sheet.distance_mm])
    return float(np.sqrt(error @ np.linalg.pinv(result.plane_covariance, rcond=1e-10, hermitian=True) @ error / 3))
