"""What calibration leaves uncertain of a merged surface, against errors drawn by lot and a part fitted to each."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.fusion.certainty import against_nominal, surface_sigma_mm
from calib_core.fusion.overlap import Patches, PoseErrors

DRAWN = 4000
CHANCE = np.random.default_rng(5)


def _box() -> Patches:
    """Two scans of a box's faces, at a place that is not the origin."""
    side = CHANCE.integers(0, 6, 240)
    normals = np.repeat(np.eye(3), 2, axis=0)[side] * np.where(side % 2, -1.0, 1.0)[:, None]
    points = CHANCE.uniform(-1, 1, (240, 3))
    points = np.where(normals != 0, normals, points) * [30, 20, 10] + [15, -40, 60]
    scans = (CHANCE.uniform(size=240) < 0.4).astype(np.int64)
    return Patches(("a", "b"), scans, points, normals, np.full(240, 4e-4), np.arange(241), 2.0)


def _errors() -> PoseErrors:
    sizes = np.array([2e-4, 3e-4, 1e-4, 0.02, 0.01, 0.03])
    roots = CHANCE.normal(size=(2, 6, 6)) * sizes[:, None] / 2
    return PoseErrors(CHANCE.normal(size=(2, 6, 2)) * sizes[:, None], roots @ np.swapaxes(roots, 1, 2))


SEEN, ERRORS = _box(), _errors()


def _moves() -> np.ndarray:
    """Return moves of both scans by errors drawn by lot, (DRAWN, 2, 6)."""
    shared = np.einsum("sid,nd->nsi", ERRORS.common, CHANCE.normal(size=(DRAWN, 2)))
    own = [CHANCE.multivariate_normal(np.zeros(6), one, DRAWN) for one in ERRORS.own]
    return shared + np.stack(own, axis=1)


def _off(moves: np.ndarray) -> np.ndarray:
    """Return how far each point comes to lie along its normal, (DRAWN, N)."""
    mine = moves[:, SEEN.scans]
    moved = np.cross(mine[..., :3], SEEN.points_mm) + mine[..., 3:]
    return np.einsum("nki,ki->nk", moved, SEEN.normals)


def test_a_surface_is_off_as_errors_drawn_by_lot_move_it() -> None:
    off = _off(_moves()) + CHANCE.normal(0, 0.02, (DRAWN, 240))
    assert surface_sigma_mm(SEEN, ERRORS) == pytest.approx(np.sqrt((off**2).mean()), rel=0.03)
    assert surface_sigma_mm(SEEN, PoseErrors.none(2)) == pytest.approx(0.02)


def test_a_nominal_at_its_place_takes_up_no_error() -> None:
    found = against_nominal(SEEN, ERRORS, np.eye(4), False, noise_mm2=0.01)
    assert not found.covariance.any()
    assert found.deviation_sigma_mm == pytest.approx(np.sqrt((_off(_moves()) ** 2).mean() + 0.01), rel=0.03)


def test_a_nominal_that_follows_the_points_is_as_uncertain_as_fits_to_errors_drawn_by_lot() -> None:
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix(), [100, 20, -30]
    off = _off(_moves())
    # The part moves by w and v in T; its points that lie at p then lie at p + w × p + v.
    ways = np.concatenate([np.cross(SEEN.points_mm, SEEN.normals), SEEN.normals], axis=1)
    moves = off @ np.linalg.pinv(ways).T
    left = off - moves @ ways.T
    turned = moves[:, :3] @ placed[:3, :3]
    shifted = moves[:, 3:] + np.cross(moves[:, :3], placed[:3, 3])
    drawn = np.cov(np.concatenate([turned, shifted], axis=1).T)
    found = against_nominal(SEEN, ERRORS, placed, True)
    size = np.sqrt(np.diag(drawn))
    assert found.covariance / np.outer(size, size) == pytest.approx(drawn / np.outer(size, size), abs=0.08)
    assert found.deviation_sigma_mm == pytest.approx(np.sqrt((left**2).mean()), rel=0.03)


def test_few_patches_tell_nothing() -> None:
    flat = Patches(
        ("a", "b"), SEEN.scans, SEEN.points_mm, SEEN.normals.copy(), SEEN.variances_mm2, SEEN.bounds, 2.0
    )
    flat.normals[9:] = 0
    assert np.isnan(against_nominal(flat, ERRORS, np.eye(4), True).deviation_sigma_mm)
    flat.normals[9] = SEEN.normals[9]
    assert np.isfinite(against_nominal(flat, ERRORS, np.eye(4), False).deviation_sigma_mm)
