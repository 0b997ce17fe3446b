"""Lines that workshops have: saturated, broken, thick."""

import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.optics.stripe_flanks import flank_centers
from calib_core.stages.laser_plane.solve import LaserPlaneResult
from calib_core.stages.pipeline import solve_stage
from tests.stripe_sets import StripeSet, stripe_set


def solved(one: StripeSet) -> LaserPlaneResult:
    result = solve_stage(one.session, "laser-plane", one.files.__getitem__)
    assert isinstance(result, LaserPlaneResult)
    return result


def sigmas(one: StripeSet, result: LaserPlaneResult) -> float:
    """Return the plane's error over what is stated, root mean square of three."""
    plane = result.plane_in_camera
    off = np.array(plane.normal) - one.cell.sheet.normal
    error = np.array([*off, plane.distance_mm - one.cell.sheet.distance_mm])
    return float(np.sqrt(error @ np.linalg.pinv(result.plane_covariance, rcond=1e-10, hermitian=True) @ error / 3))


@pytest.mark.parametrize("kind", ["broken", "thick-6", "pairs-along"])
def test_lines_that_a_person_sees_are_used_and_as_well_known_as_stated(kind: str) -> None:
    one = stripe_set(kind, 0)
    result = solved(one)
    dropped = [
        row.reason or "" for row in result.residuals if not row.used and "chessboard" not in (row.reason or "")
    ]
    assert len(dropped) <= 1
    assert sigmas(one, result) < 3


def test_boards_without_the_laser_take_no_line() -> None:
    off = frozenset({0, 2, 5})
    result = solved(one := stripe_set("speckled", 3, laser_off=off))
    assert [row.used for row in result.residuals if row.capture in {f"l{k + 1:02d}" for k in off}] == [False] * 3
    assert sum(row.used for row in result.residuals) >= 4
    assert sigmas(one, result) < 3
    dark = stripe_set("clean", 4, boards=5, laser_off=frozenset(range(5)))
    with pytest.raises(MotionError, match="on at least two boards"):
        solved(dark)


def test_the_line_beside_the_squares_is_found_on_the_sheet() -> None:
    one = stripe_set("beside", 2)
    result = solved(one)
    seen = [row for row in result.residuals if "chessboard" not in (row.reason or "")]
    assert len(seen) >= 5
    assert all(row.used for row in seen)
    assert sigmas(one, result) < 3


def test_the_middle_of_a_saturated_stripe_is_between_its_flanks() -> None:
    rows = np.arange(120)[:, None]
    middle = 57.3 + 0.05 * np.arange(80)
    light = 10 + 2000 * np.exp(-0.5 * ((rows - middle) / 4.0) ** 2)
    columns, found, sigma, width = flank_centers(np.clip(light, 0, 255).astype(np.uint8), 255.0, 1.0)
    assert len(columns) == 80
    np.testing.assert_allclose(found, middle, atol=0.1)
    assert (sigma < 0.3).all()
    assert 5 < width < 12  # as wide as it looks
