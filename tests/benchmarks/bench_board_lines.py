"""Lines on boards as workshops have them: how many are used, whether the ± holds, and boards without a laser."""

import numpy as np
from harness import Row

from calib_core.errors import CalibrationError
from calib_core.stages.laser_plane.solve import LaserPlaneResult
from calib_core.stages.pipeline import solve_stage
from tests.stripe_sets import KINDS, StripeSet, stripe_set

_UNSEEN = "chessboard"  # in the reason of a frame whose board was not found: that is not the line's


def run(full: bool) -> list[Row]:
    """Return the rows; `full` takes twenty sets of each kind, otherwise one."""
    seeds = range(20 if full else 1)
    used, seen, ratios, false_passes, refused = 0, 0, [], 0, 0
    for one in (stripe_set(kind, 100 + seed) for kind in KINDS for seed in seeds):
        result = _solved(one)
        if result is None:
            refused += 1
            continue
        lines = [row for row in result.residuals if _UNSEEN not in (row.reason or "")]
        used, seen = used + sum(row.used for row in lines), seen + len(lines)
        ratios.append(_ratio(one, result))
        false_passes += result.verdict == "pass" and ratios[-1] > 3
    rms = float(np.sqrt(np.mean(np.square(ratios))))
    sets = f"{len(KINDS)} kinds × {len(seeds)}"
    taken, frames = _taken_without_laser(range(50 if full else 2))
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
    taken, frames = 0, 0
    off = frozenset(range(0, 8, 2))
    for seed in seeds:
        for kind in ("clean", "speckled", "pairs-along"):
            result = _solved(stripe_set(kind, 200 + seed, laser_off=off))
            frames += len(off)
            rows = [] if result is None else result.residuals
            taken += sum(row.used for row in rows if int(row.capture[1:]) - 1 in off)
    return taken, frames


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
