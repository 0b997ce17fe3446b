"""Boards whose lines are off by more than their own ±: weighed and stated so; right ones stay as they are."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.optics.laser_plane_borne_out import Boards
from calib_core.optics.laser_plane_solve import PlaneSolution, PlaneView, solve_plane
from tests.core.test_optics_plane import CAMERA, DISTANCE, NORMAL, views

EXCESS_PX = 0.15


def off_by(seen: list[PlaneView], means_px: np.ndarray, ends_px: np.ndarray) -> list[PlaneView]:
    """Return the boards with each one's line moved and turned as a whole."""
    return [
        replace(view, stripe=view.stripe.shifted(mean + end * np.linspace(-1, 1, len(view.stripe.row_px))))
        for view, mean, end in zip(seen, means_px, ends_px, strict=True)
    ]


def as_many(_: Boards) -> float:
    """Tell what is said of boards without number."""
    return 1.0


def squared(found: PlaneSolution) -> float:
    """Return the plane's squared error in stated standard deviations, of three degrees of freedom."""
    error = np.array([*(found.normal - NORMAL), found.distance_mm - DISTANCE])
    return float(error @ np.linalg.pinv(found.covariance, rcond=1e-10, hermitian=True) @ error)


def test_boards_that_disagree_as_they_state_add_next_to_nothing() -> None:
    found = [solve_plane(CAMERA, views(seed)) for seed in range(8)]
    # 160 centres of 0.05 px know a line's mean to 0.004 px, a board's corners to 0.007 px.
    assert np.median([one.excess_px for one in found]) < 0.015
    assert max(one.excess_px for one in found) < 0.05


def scattered(seed: int) -> PlaneSolution:
    """Return the plane of boards whose lines are each off as a whole, in mean and slope."""
    rng = np.random.default_rng(77 + seed)
    return solve_plane(CAMERA, off_by(views(seed), *rng.normal(0, EXCESS_PX, (2, 8))))


def test_lines_that_are_each_off_as_a_whole_are_found_to_be_and_the_plane_says_so() -> None:
    found = [scattered(seed) for seed in range(24)]
    assert 0.5 * EXCESS_PX < np.median([one.excess_px for one in found]) < 1.5 * EXCESS_PX
    # The mean of 24 χ² of 3 is 3 ± 1.96 √(2·3/24) = ± 0.98; scatter known from 13 degrees widens it by 13/11.
    assert 1.5 < np.mean([squared(one) for one in found]) < 4.7


@pytest.mark.parametrize("seed", [15, 35, 46])
def test_a_board_off_by_what_scatters_the_others_too_belongs_to_them(seed: int) -> None:
    """Of 48 sets these left out a line: a robust plane rests on the few that happen to agree."""
    found = scattered(seed)
    assert not [view.left_out for view in found.views if view.left_out]
    assert 0.5 * EXCESS_PX < found.excess_px < 1.5 * EXCESS_PX


@pytest.mark.parametrize("moved_px", [1.0, 2.0, 15.0])
def test_a_board_that_was_moved_is_left_out_and_tells_nothing_of_the_others(moved_px: float) -> None:
    moved = solve_plane(CAMERA, off_by(views(4), np.where(np.arange(8) == 2, moved_px, 0.0), np.zeros(8)))
    assert [view.name for view in moved.views if view.left_out == "off-plane"] == ["l2"]
    assert moved.excess_px < 0.05
    # Its ± is that of the seven others alone.
    seven = solve_plane(CAMERA, [view for view in views(4) if view.name != "l2"])
    np.testing.assert_allclose(moved.covariance, seven.covariance, rtol=1e-3, atol=1e-12)


def test_one_board_that_is_sure_of_itself_and_wrong_no_longer_lays_the_plane_alone() -> None:
    seen = views(3)
    sure = np.where(np.arange(8) == 2, 0.3, 0.0)
    moved = solve_plane(CAMERA, off_by(seen, sure, 0 * sure))
    angle = np.rad2deg(np.arccos(moved.normal @ NORMAL))
    assert moved.excess_px > 0.03
    assert angle < 3 * np.rad2deg(np.sqrt(np.trace(moved.covariance[:3, :3])))


# A line has two terms, and three of all are the plane's: 5 and 13 degrees; the stated ± count as two lines: 4.
# Student's t of n degrees has a variance of n / (n − 2).
@pytest.mark.parametrize(("count", "factor"), [(4, 9 / 7), (8, 17 / 15)])
def test_few_boards_know_their_own_scatter_less(
    count: int, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated = solve_plane(CAMERA, views(1, count)).covariance
    monkeypatch.setattr("calib_core.optics.laser_plane_joint.student", as_many)
    np.testing.assert_allclose(
        stated, factor * solve_plane(CAMERA, views(1, count)).covariance, rtol=1e-4, atol=1e-12
    )
