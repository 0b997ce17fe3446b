"""Cleaning on the grid: what is stray, mixed or grazing goes, the rest stays and has the right normal."""

import numpy as np
import pytest

from calib_core.errors import MeasurementError
from calib_core.frames import RigidTransform
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.clean_scan import BLANK, GRAZING, KEPT, MIXED, STRAY, CleanOptions
from calib_core.fusion.scan import Scan, as_rows

SIGMA_MM = 0.02
PITCH_MM = 0.2


def surface(count: int = 160) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, C, 3) of a waved surface below the scanner and the unit normals toward it."""
    x = (np.arange(count) - count / 2) * PITCH_MM
    X, Y = np.meshgrid(x, x)
    Z = 300 + 3 * np.sin(X / 9) * np.cos(Y / 7)
    slope = np.stack(
        [np.cos(X / 9) * np.cos(Y / 7) / 3, -3 / 7 * np.sin(X / 9) * np.sin(Y / 7), -np.ones_like(X)], -1
    )
    return np.stack([X, Y, Z], -1), slope / np.linalg.norm(slope, axis=-1, keepdims=True)


def scan(points: np.ndarray, pose: np.ndarray | None = None, **options: float) -> Scan:
    matrix = np.eye(4) if pose is None else pose
    return Scan("s1", points.astype(np.float32), matrix[None], SIGMA_MM, **options)


def test_strays_go_and_the_surface_stays():
    rng = np.random.default_rng(0)
    truth, _ = surface()
    points = truth + np.array([0, 0, 1]) * rng.normal(0, SIGMA_MM, truth.shape[:2])[..., None]
    stray = rng.random(truth.shape[:2]) < 0.03
    points[stray, 2] = rng.uniform(250, 350, stray.sum())
    clearly = stray & (np.abs(points[..., 2] - truth[..., 2]) > 10 * SIGMA_MM)
    cleaned = clean_scan(scan(points))
    dropped = cleaned.verdicts != KEPT
    assert dropped[clearly].mean() > 0.99
    assert dropped[~stray].mean() < 0.002
    assert sum(cleaned.removed().values()) == (dropped & np.isfinite(points[..., 2])).sum()


def test_normals_point_to_the_scanner_and_are_as_exact_as_the_noise_allows():
    rng = np.random.default_rng(1)
    truth, normals = surface()
    noisy = truth + normals * rng.normal(0, SIGMA_MM, truth.shape[:2])[..., None]
    cleaned = clean_scan(scan(noisy))
    inner = (slice(2, -2), slice(2, -2))
    angle = np.arccos(np.clip((cleaned.normals * normals).sum(-1), -1, 1))[inner]
    # slopes from 5×5 points: σ / (pitch √50) in each of two directions
    expected = np.sqrt(2) * SIGMA_MM / (PITCH_MM * np.sqrt(50))
    assert np.sqrt(np.mean(angle**2)) == pytest.approx(expected, rel=0.1)


def test_normals_and_points_are_in_t():
    rng = np.random.default_rng(2)
    truth, normals = surface(40)
    pose = RigidTransform.of(rng.normal(size=3), rng.normal(size=3) * 100, "turntable", "laser")
    cleaned = clean_scan(scan(truth, pose.matrix))
    np.testing.assert_allclose(cleaned.points_in_turntable_mm, pose.apply(truth), atol=1e-3)
    assert ((cleaned.normals * pose.rotate(normals)).sum(-1)[2:-2, 2:-2] > 0.9999).all()


def test_each_profile_may_have_a_pose_of_its_own():
    truth, normals = surface(60)
    profiles = truth.copy()
    profiles[..., 1] = 0.0
    poses = np.tile(np.eye(4), (60, 1, 1))
    poses[:, 1, 3] = truth[:, 0, 1]
    cleaned = clean_scan(Scan("sweep", profiles.astype(np.float32), poses, SIGMA_MM))
    np.testing.assert_allclose(cleaned.points_in_turntable_mm, truth, atol=1e-4)
    assert ((cleaned.normals * normals).sum(-1)[2:-2, 2:-2] > 0.9999).all()


def test_mixed_points_between_foreground_and_background_go():
    truth, _ = surface(80)
    points = truth.copy()
    points[:, 40:, 2] += 20.0
    mixed = np.zeros(points.shape[:2], bool)
    mixed[:, 40] = True
    points[:, 40, 2] = points[:, 39, 2] + 8.0
    cleaned = clean_scan(scan(points))
    inner = mixed.copy()
    inner[:2] = inner[-2:] = False
    assert np.isin(cleaned.verdicts[inner], [MIXED, STRAY]).all()
    assert (cleaned.verdicts[~mixed] == KEPT).mean() > 0.99
    assert cleaned.removed()["mixed"] > 60


def test_grazing_angles_go_by_the_angle_that_is_asked():
    x = np.arange(-30, 30) * PITCH_MM
    X, Y = np.meshgrid(x, x)
    steep = np.stack([X, Y, 300 + np.tan(np.deg2rad(70)) * X], -1)
    assert (clean_scan(scan(steep)).verdicts == KEPT).all()
    flat = np.stack([X, Y, np.full_like(X, 300.0)], -1)
    both = np.concatenate([flat, steep], axis=0)
    verdicts = clean_scan(scan(both), CleanOptions(grazing_deg=65)).verdicts
    assert (verdicts[65:, 3:-3] == GRAZING).all()
    assert (verdicts[:55] == KEPT).all()


def test_uncertainty_grows_with_the_angle_and_holds_the_scans_own_place():
    x = np.arange(-30, 30) * PITCH_MM
    X, Y = np.meshgrid(x, x)
    tilted = np.stack([X, Y, 300 + np.tan(np.deg2rad(60)) * X], -1)
    cleaned = clean_scan(scan(tilted, position_sigma_mm=0.03))
    assert cleaned.sigma_mm[30, 30] == pytest.approx(np.hypot(2 * SIGMA_MM, 0.03), rel=1e-3)


def test_blanks_stay_blank():
    points, _ = surface(40)
    points[10:14, 5:30] = np.nan
    cleaned = clean_scan(scan(points))
    assert (cleaned.verdicts[10:14, 5:30] == BLANK).all()
    assert (cleaned.verdicts[20:] == KEPT).all()


def test_threads_do_not_change_the_answer():
    rng = np.random.default_rng(3)
    points, _ = surface(50)
    points[rng.random((50, 50)) < 0.05, 2] += 4.0
    one, three = (clean_scan(scan(points), CleanOptions(workers=n)) for n in (1, 3))
    assert np.array_equal(one.verdicts, three.verdicts)
    np.testing.assert_array_equal(one.normals, three.normals)


def test_a_cloud_without_order_is_cleaned_by_its_neighbours_in_space():
    rng = np.random.default_rng(4)
    truth, normals = surface(60)
    order = rng.permutation(3600)
    points = truth.reshape(-1, 3)[order] + rng.normal(0, 0.2 * SIGMA_MM, (3600, 3))
    stray = rng.random(3600) < 0.02
    points[stray, 2] += rng.choice([-1, 1], stray.sum()) * rng.uniform(5, 30, stray.sum())
    rows = as_rows(points.astype(np.float32))
    cleaned = clean_scan(Scan("c", rows, np.eye(4)[None], organised=False, point_sigma_mm=SIGMA_MM))
    verdicts, found = cleaned.verdicts.ravel()[:3600], cleaned.normals.reshape(-1, 3)[:3600]
    assert (verdicts[stray] == STRAY).all()
    assert (verdicts[~stray] == KEPT).mean() > 0.98
    assert np.median((found * normals.reshape(-1, 3)[order]).sum(-1)[verdicts == KEPT]) > 0.99


def test_a_scan_of_nothing_but_strays_is_refused():
    points = np.full((20, 20, 3), np.nan)
    points[::4, ::4] = np.random.default_rng(5).uniform(-500, 500, (5, 5, 3))
    with pytest.raises(MeasurementError, match=r"s1: need points on a surface, got none among 25"):
        clean_scan(scan(points))
