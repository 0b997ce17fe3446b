"""The camera model: beside OpenCV's, and its exact inverse."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import InputError
from calib_core.optics.camera_model import COEFFICIENTS, CameraModel, Segment
from calib_core.records import KnownCamera

MATRIX = np.array([[2400.0, 0, 650.5], [0, 2380.0, 500.25], [0, 0, 1]])
PLAIN = np.array([-0.21, 0.13, 0.0011, -0.0007, 0.02])
RATIONAL = np.array([0.4, -0.3, 0.001, -0.002, 0.05, 0.6, -0.2, 0.03])
FULL = np.array([0.4, -0.3, 0.001, -0.002, 0.05, 0.6, -0.2, 0.03, 0.002, -0.001, 0.0015, 0.001, 0.09, -0.05])
SIZE = (1280, 1024)


def points_in_view(seed: int, count: int = 500) -> np.ndarray:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(200, 600, count)
    rays = rng.uniform([-0.26, -0.2], [0.26, 0.2], (count, 2))
    return np.column_stack([rays * depth[:, None], depth])


def segmental() -> CameraModel:
    near, far = np.zeros(14), np.zeros(14)
    near[:5] = PLAIN
    far[:5] = PLAIN * [0.8, 1.3, 1.0, 2.0, 0.5]
    bands = (Segment(200.0, 420.0, near), Segment(380.0, 600.0, far))
    return CameraModel(MATRIX, near, "segmental", SIZE, bands)


@pytest.mark.parametrize("distortion", [PLAIN, RATIONAL, FULL], ids=["plain", "rational", "tilted"])
def test_projection_is_opencvs(distortion: np.ndarray) -> None:
    points = points_in_view(1)
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), MATRIX, distortion)[0][:, 0]
    np.testing.assert_allclose(CameraModel(MATRIX, distortion).project(points), expected, atol=1e-9)


@pytest.mark.parametrize(
    "distortion", [np.zeros(5), PLAIN, RATIONAL, FULL], ids=["none", "plain", "rational", "tilted"]
)
def test_undistort_is_the_exact_inverse(distortion: np.ndarray) -> None:
    camera = CameraModel(MATRIX, distortion)
    points = points_in_view(2)
    rays = camera.undistort(camera.project(points))
    # 0.02 µm at 600 mm is 3e-8 of the depth
    np.testing.assert_allclose(rays, points[:, :2] / points[:, 2:], atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-0.3, 0.3), st.floats(-0.2, 0.2), st.floats(-0.003, 0.003), st.floats(-0.003, 0.003),
    st.floats(-0.1, 0.1), st.floats(-0.12, 0.12), st.floats(-0.12, 0.12),
)  # fmt: skip
def test_undistort_inverts_any_ordinary_lens(
    k1: float, k2: float, p1: float, p2: float, k3: float, tilt_x: float, tilt_y: float
) -> None:
    names = {"k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3, "tauX": tilt_x, "tauY": tilt_y}
    camera = CameraModel.from_names(MATRIX, names, SIZE)
    points = points_in_view(3, 60)
    np.testing.assert_allclose(camera.undistort(camera.project(points)), points[:, :2] / points[:, 2:], atol=1e-9)


def test_pixels_that_no_ray_reaches_are_nan() -> None:
    camera = CameraModel(MATRIX, np.array([-0.5, 0, 0, 0, 0]))  # the image of rays ends at r = sqrt(2/3)
    rays = camera.undistort([[650.5, 500.25], [650.5 + 2400 * 0.9, 500.25]])
    assert np.allclose(rays[0], 0)
    assert np.isnan(rays[1]).all()


def test_points_behind_the_camera_are_nan() -> None:
    assert np.isnan(CameraModel(MATRIX).project([[1.0, 2.0, -300.0], [0, 0, 0]])).all()


def test_bands_blend_without_a_step() -> None:
    camera = segmental()
    depth = np.linspace(370, 430, 6001)
    u = camera.project(np.column_stack([0.2 * depth, 0.15 * depth, depth]))[:, 0]
    first = CameraModel(MATRIX, camera.segments[0].distortion).project([[0.2, 0.15, 1.0]])[0, 0]
    last = CameraModel(MATRIX, camera.segments[1].distortion).project([[0.2, 0.15, 1.0]])[0, 0]
    assert u[0] == first
    assert u[-1] == last
    assert abs(last - first) > 0.5  # the bands differ, or the test says nothing
    assert np.abs(np.diff(u)).max() < abs(last - first) / 4000 * 1.01
    assert u[3000] == pytest.approx((first + last) / 2)


def test_a_segmental_camera_finds_its_band_by_the_plane_of_light() -> None:
    normal, distance = np.array([0.0, 0.8, 0.6]), 240.0
    camera = segmental().with_laser_plane(normal, distance)
    rays = points_in_view(4)[:, :2] / points_in_view(4)[:, 2:]
    rays = np.column_stack([rays, np.ones(len(rays))])
    on_plane = rays * (distance / (rays @ normal))[:, None]
    assert on_plane[:, 2].min() < 380
    assert on_plane[:, 2].max() > 420
    np.testing.assert_allclose(camera.undistort(camera.project(on_plane)), rays[:, :2], atol=1e-11)


def test_a_segmental_camera_takes_depths_instead() -> None:
    points = points_in_view(5)
    camera = segmental()
    rays = camera.undistort(camera.project(points), depth_mm=points[:, 2])
    np.testing.assert_allclose(rays, points[:, :2] / points[:, 2:], atol=1e-11)
    with pytest.raises(InputError, match=r"Calibrate the laser plane first\."):
        camera.undistort([[100.0, 100.0]])


def test_known_camera_by_names() -> None:
    known = KnownCamera(camera_matrix=MATRIX.tolist(), distortion={"k1": -0.35, "p2": 0.001, "tauX": 0.1})
    camera = CameraModel.from_known(known)
    assert camera.model == "tilted"
    assert camera.distortion_by_name == {"k1": -0.35, "k2": 0, "p1": 0, "p2": 0.001, "k3": 0, "tauX": 0.1}
    with pytest.raises(InputError, match="k9"):
        CameraModel.from_names(MATRIX, {"k9": 1.0})
    assert len(COEFFICIENTS) == 14


def test_numbers_that_are_no_camera() -> None:
    with pytest.raises(InputError, match="positive focal lengths"):
        CameraModel(np.diag([-500.0, 500.0, 1.0]))
    with pytest.raises(InputError, match="NaN"):
        CameraModel(MATRIX, np.array([np.nan]))
    with pytest.raises(InputError, match="two bands"):
        CameraModel(MATRIX, PLAIN, "segmental")
