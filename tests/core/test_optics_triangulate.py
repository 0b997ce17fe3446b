"""Pixels to points of L: the inverse of projecting points of the plane, with true covariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane import (
    camera_from_laser_covariance,
    camera_from_laser_of,
    oriented_plane,
    plane_covariance_from_inverse,
)
from calib_core.optics.stripe import StripeCenters
from calib_core.optics.triangulate import (
    ProfileCalibration,
    stripe_in_frame,
    triangulate,
    triangulate_stripe,
)

MATRIX = np.array([[900.0, 0, 320.0], [0, 905.0, 240.0], [0, 0, 1]])
NORMAL, DISTANCE = np.array([0.03, np.cos(0.5), np.sin(0.5)]), 120.0

CAMERAS = {
    "plain": {"k1": -0.12, "k2": 0.08, "p1": 4e-4, "p2": -3e-4},
    "rational": {"k1": 0.4, "k2": 0.1, "k4": 0.5, "k5": 0.1, "p1": 1e-4, "s1": 1e-4},
    "tilted": {"k1": -0.12, "k2": 0.08, "tauX": 0.09, "tauY": -0.02},
}


def calibration(name: str = "plain") -> ProfileCalibration:
    return ProfileCalibration.of(CameraModel.from_names(MATRIX, CAMERAS[name], (640, 480)), NORMAL, DISTANCE)


def points_on_plane(c: ProfileCalibration, count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.column_stack([rng.uniform(-40, 40, count), np.zeros(count), rng.uniform(170, 280, count)])


@pytest.mark.parametrize("name", CAMERAS)
def test_projected_points_come_back(name: str) -> None:
    c = calibration(name)
    points = points_on_plane(c)
    pixels = c.camera.project(c.camera_from_laser.apply(points))
    # 0.02 µm, the figure for the kernel's iteration.
    np.testing.assert_allclose(c.points(pixels), points, atol=2e-5)
    assert np.all(c.points(pixels)[:, 1] == 0)


STRONG = np.array([[500.0, 0, 320.0], [0, 500.0, 240.0], [0, 0, 1]])


def test_a_strong_lens_keeps_every_ray_that_it_has() -> None:
    """Newton's last step leaves 1e-8: rays that were found counted as lost, 61 of these 400."""
    camera = CameraModel.from_names(STRONG, {"k1": -0.3, "k2": 0.05, "k3": 0.03}, (640, 480))
    diagonal = np.column_stack([np.linspace(0, 319, 400), np.linspace(0, 239, 400)])
    rays = camera.undistort(diagonal)
    assert np.isinf(camera.fold)
    np.testing.assert_allclose(camera.project(np.column_stack([rays, np.ones(400)])), diagonal, atol=1e-4)


def test_rays_beyond_the_fold_are_dropped_and_counted() -> None:
    """The polynomial turns back at 0.7525 and rises again: beyond, a pixel seemed to have a ray of that branch."""
    camera = CameraModel.from_names(STRONG, {"k1": -0.8, "k2": 0.2, "k3": 0.03}, (640, 480))
    assert camera.fold == pytest.approx(0.7525, abs=2e-3)
    diagonal = np.column_stack([np.linspace(0, 319, 400), np.linspace(0, 239, 400)])
    rays = camera.undistort(diagonal)
    lost = np.isnan(rays[:, 0])
    assert 100 < lost.sum() < 250
    assert not lost[np.argmax(lost == 0) :].any()  # a border, beyond which all is lost
    assert np.hypot(*rays[~lost].T).max() <= camera.fold
    light = ProfileCalibration.of(camera, NORMAL, DISTANCE)
    np.testing.assert_array_equal(np.isnan(light.points(diagonal)[:, 0]), lost)
    one = np.ones(400)
    stripe = StripeCenters(diagonal[:, 0], diagonal[:, 1], 0.05 * one, 100 * one, "columns", 2.0, 1.0)
    assert triangulate_stripe(light, stripe).without_ray == lost.sum()


def test_covariance_is_that_of_repeated_noise() -> None:
    c = calibration()
    point = np.array([[12.0, 0.0, 231.0]])
    pixel = c.camera.project(c.camera_from_laser.apply(point))
    noise = np.zeros((20_000, 2))
    noise[:, 1] = np.random.default_rng(1).normal(0, 0.1, 20_000)
    scattered = c.points(pixel + noise)[:, [0, 2]]
    stated = triangulate(c, pixel, 0.1).covariance[0]
    # Variances of 20000 samples are known to 1 %.
    np.testing.assert_allclose(np.cov(scattered.T), stated, rtol=0.04, atol=1e-9)


def test_a_frame_of_its_own_is_respected_and_one_off_the_plane_refused() -> None:
    camera = calibration().camera
    turned = camera_from_laser_of(NORMAL, DISTANCE).perturbed([0, 0.3, 0, 0, 0, 0])
    c = ProfileCalibration.of(camera, NORMAL, DISTANCE, turned)
    points = points_on_plane(c)
    np.testing.assert_allclose(c.points(camera.project(turned.apply(points))), points, atol=2e-5)
    off = RigidTransform.of(turned.rotation, turned.translation_mm + 5 * turned.rotation[:, 1], "camera", "laser")
    with pytest.raises(InputError, match="off the plane"):
        ProfileCalibration.of(camera, NORMAL, DISTANCE, off)


@settings(deadline=None)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1), st.floats(1, 500))
def test_the_rule_of_the_frame_l(normal: tuple[float, float, float], distance_mm: float) -> None:
    frame = camera_from_laser_of(normal, distance_mm)
    n, d = oriented_plane(normal, distance_mm)
    np.testing.assert_allclose(frame.rotation[:, 1], n, atol=1e-12)
    np.testing.assert_allclose(frame.translation_mm, d * n, atol=1e-9)
    assert d > 0
    assert frame.rotation[2, 2] >= -1e-9  # z goes away from the camera
    same = camera_from_laser_of(-np.array(normal), -distance_mm)
    np.testing.assert_allclose(same.matrix, frame.matrix, atol=1e-12)


@pytest.mark.thorough
def test_the_plane_covariance_is_carried_to_the_frame() -> None:
    rng = np.random.default_rng(5)
    n, d = oriented_plane(NORMAL, DISTANCE)
    q, factor = n / d, rng.normal(size=(3, 3)) * 1e-6
    covariance = plane_covariance_from_inverse(q, factor @ factor.T)
    stated = camera_from_laser_covariance(n, d, covariance)
    frame = camera_from_laser_of(n, d)
    samples = []
    for _ in range(4000):
        moved = q + factor @ rng.normal(size=3)
        length = np.linalg.norm(moved)
        samples.append(frame.difference(camera_from_laser_of(moved / length, 1 / length)))
    scale = np.sqrt(np.diag(stated)) + 1e-12
    # Correlations of 4000 samples are known to 0.016.
    np.testing.assert_allclose(np.cov(np.array(samples).T) / np.outer(scale, scale),
                               stated / np.outer(scale, scale), atol=0.08)  # fmt: skip


def test_planes_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="runs through it"):
        oriented_plane([0, 1, 0], 0.0)
    with pytest.raises(InputError, match="three finite numbers"):
        oriented_plane([0, np.nan, 0], 1.0)


def test_a_frame_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="640×480"):
        stripe_in_frame(np.zeros((100, 100), np.uint8), calibration())
