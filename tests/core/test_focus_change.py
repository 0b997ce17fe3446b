"""Boards seen with two focal lengths are told apart from boards seen with one."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_layout import parameter_places
from calib_core.optics.focus_change import is_changed
from calib_core.optics.laser_plane_joint import CameraUncertainty
from calib_core.optics.laser_plane_solve import PlaneSolution, solve_plane
from tests.core import test_optics_plane
from tests.core.test_optics_plane import CAMERA, MATRIX, view, views


def solved(factor: float, seed: int, monkeypatch: pytest.MonkeyPatch, lit: int = 10) -> PlaneSolution:
    """Return the plane by boards that were seen with another focal length than those of the camera's frames."""
    rng = np.random.default_rng([seed, 43])
    boards = [view(rng, 0.05, 0.05, depth, "c").board for depth in np.linspace(190, 300, lit)]
    other = MATRIX * [[factor], [factor], [1.0]]
    other[:2, 2] = MATRIX[:2, 2]
    with monkeypatch.context() as patch:
        patch.setattr(test_optics_plane, "CAMERA", replace(CAMERA, camera_matrix=other))
        seen = views(seed + 1000)
    # The boards with the stripe serve the camera, too.
    found = calibrate_camera([*boards, *(v.board for v in seen)], (640, 480), CameraOptions(model="plain"))
    known = CameraUncertainty(parameter_places(found.parameters), found.covariance, tuple(boards))
    return solve_plane(found.camera, seen, known)


@pytest.mark.parametrize("factor", [0.98, 1.015])
def test_a_lens_that_was_focused_anew_is_told_with_its_change(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    focus = solved(factor, 1, monkeypatch).focus
    assert focus is not None
    assert is_changed(focus)
    assert abs(focus.factor - factor) < 3 * focus.sigma


def test_one_focal_length_is_told_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [solved(1.0, seed, monkeypatch).focus for seed in range(4)]
    assert not any(one is None or is_changed(one) for one in found)
    pulls = [(one.factor - 1.0) / one.sigma for one in found if one is not None]
    assert 0.05 < np.mean(np.square(pulls)) < 3.5  # χ² of 4 degrees over 4: beyond in one of 200 at each end


def test_few_boards_tell_no_change(monkeypatch: pytest.MonkeyPatch) -> None:
    assert solved(1.02, 1, monkeypatch, lit=3).focus is None


def beside_told(factor: float, seed: int, count: int = 8) -> PlaneSolution:
    """Return the plane by a told camera whose focal length was another when it was calibrated."""
    other = MATRIX * [[factor], [factor], [1.0]]
    other[:2, 2] = MATRIX[:2, 2]
    return solve_plane(replace(CAMERA, camera_matrix=other), views(seed, count))


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_told_camera_that_was_focused_anew_is_told(factor: float) -> None:
    focus = beside_told(factor, 3).focus
    assert focus is not None
    assert is_changed(focus)
    assert focus.is_of_told
    assert abs(focus.factor - 1 / factor) < 3 * focus.sigma


def test_a_told_camera_that_is_right_is_accused_of_nothing() -> None:
    found = [beside_told(1.0, seed).focus for seed in range(12)]
    assert not any(one is None or is_changed(one) for one in found)
    pulls = [(one.factor - 1.0) / one.sigma for one in found if one is not None]
    assert 0.3 < np.mean(np.square(pulls)) < 2.4  # χ² of 12 degrees over 12: beyond in one of 200 at each end


def test_five_boards_tell_nothing_of_a_told_camera() -> None:
    assert beside_told(1.02, 3, 5).focus is None
