"""What excluding one capture would do, told before anything is solved again, beside a solve without it."""

import numpy as np
import pytest
from cells import GIVEN, SPHERE, Cell

from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpOptions, TcpSolution
from calib_core.frames import FloatArray


def worst_sigma_mm(solution: TcpSolution, point_in_laser_mm: FloatArray) -> float:
    at_point = solution.held.at_point(point_in_laser_mm, solution.held.half_width_mm)
    return float(np.sqrt(np.linalg.eigvalsh(at_point)[-1]))


@pytest.mark.thorough
def test_the_preview_is_what_a_solve_without_the_capture_answers() -> None:
    of = Cell.of("tcp", 4)
    whole = of.solve(GIVEN)
    hold = TcpOptions(
        whole.noise.sigmas.position_mm, whole.noise.sigmas.orientation_rad, whole.noise.point_sigma_mm
    )
    point = whole.in_view.seen_mm
    tool = whole.joint.mount_from_laser
    sigma_mm = worst_sigma_mm(whole, point)
    shifts: list[float] = []
    for k in (0, 3, 5, 11):
        alone = solve_tcp([o for n, o in enumerate(of.observations) if n != k], SPHERE, hold)
        moved_mm = float(np.linalg.norm(alone.joint.mount_from_laser.apply(point) - tool.apply(point)))
        assert abs(whole.each.influence.shift_mm[k] - moved_mm) < 0.1 * sigma_mm
        grown = worst_sigma_mm(alone, point) / sigma_mm
        assert whole.each.influence.growth[k] == np.clip(whole.each.influence.growth[k], grown - 0.1, grown + 0.1)
        shifts.append(moved_mm)
    assert max(shifts) > 0.3 * sigma_mm  # the preview had something to tell
    assert (whole.each.influence.growth[whole.each.used] >= 1 - 1e-9).all()


def test_a_rejected_capture_has_no_influence_to_lose() -> None:
    solution = Cell.of("tcp-moved-sphere", 7).solve(GIVEN)
    rejected = ~solution.each.used
    assert rejected.any()
    assert np.isnan(solution.each.influence.shift_mm[rejected]).all()
    assert np.isfinite(solution.each.influence.shift_mm[solution.each.used]).all()
