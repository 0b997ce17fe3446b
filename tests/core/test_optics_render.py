"""Rendered frames show what they should: their truth is what an ideal observer finds in them."""

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.stripe import find_stripe
from calib_core.optics.triangulate import ProfileCalibration, triangulate_stripe
from calib_core.simulation import FRAME_SCENARIOS, SimulatedSession, simulate
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_cell import FrameScenario, simulate_frames
from calib_core.simulation.frame_surfaces import BoardSurface, PlaneSurface, SphereSurface
from calib_core.simulation.frames import Exposure, LightSheet, light, render, sense
from calib_core.simulation.motion import pose, turn
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult

NORMAL = np.array([0.0, np.cos(0.5), np.sin(0.5)])
SHEET = LightSheet(NORMAL, 120.0, 120.0 * NORMAL)
SMALL = {"width": 320, "height": 240, "focal_px": (450.0, 451.0), "center_px": (159.0, 121.0)}
QUIET = Exposure(read_noise=0.0, photon_gain=0.0, speckle=0.0, vignetting=0.0, bits=16)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.08, -0.03)])
def test_rays_are_the_inverse_of_pixels(tilt: tuple[float, float]) -> None:
    camera = SimulatedCamera(**SMALL, tilt_rad=tilt)
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    seen = camera.pixels(camera.rays.reshape(-1, 3) * 300.0)
    np.testing.assert_allclose(seen, np.column_stack([columns.ravel(), rows.ravel()]), atol=1e-9)


def test_the_two_camera_models_agree() -> None:
    camera = SimulatedCamera(radial=(-0.1, 0.05, 0.01, 0.02, 0.01, 0.0), tilt_rad=(0.08, -0.03))
    names = dict(zip(("k1", "k2", "k3", "k4", "k5", "k6"), camera.radial, strict=True))
    (fx, fy), (cx, cy) = camera.focal_px, camera.center_px
    model = CameraModel.from_names(
        [[fx, 0, cx], [0, fy, cy], [0, 0, 1]],
        {**names, "p1": camera.tangential[0], "p2": camera.tangential[1], "tauX": 0.08, "tauY": -0.03},
    )
    points = np.random.default_rng(1).uniform([-60, -45, 200], [60, 45, 300], (500, 3))
    np.testing.assert_allclose(model.project(points), camera.pixels(points), atol=1e-9)


@pytest.mark.thorough
def test_the_stripe_lies_on_the_plane_of_light() -> None:
    camera = SimulatedCamera()
    (fx, fy), (cx, cy) = camera.focal_px, camera.center_px
    k1, k2, k3 = camera.radial
    p1, p2 = camera.tangential
    model = CameraModel.from_names(
        [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], {"k1": k1, "k2": k2, "k3": k3, "p1": p1, "p2": p2}, (640, 480)
    )
    calibration = ProfileCalibration.of(model, NORMAL, 120.0)
    center, radius = calibration.camera_from_laser.apply([[3.0, 12.0, 230.0]])[0], 30.0
    image = render(camera, [SphereSurface(center, radius)], SHEET, QUIET, np.random.default_rng(0))
    points = triangulate_stripe(calibration, find_stripe(image)).points_in_laser_mm
    circle = np.hypot(points[:, 0] - 3.0, points[:, 2] - 230.0)
    near_top = np.abs(points[:, 0] - 3.0) < 15.0
    # The circle of the cut: √(30² − 12²).  A pixel is 0.25 mm here; blur over a curved line moves it a little.
    assert near_top.sum() > 80
    np.testing.assert_allclose(circle[near_top], np.sqrt(30.0**2 - 12.0**2), atol=0.03)


def test_a_board_shows_its_corners_where_the_camera_puts_them() -> None:
    camera = SimulatedCamera(**SMALL)
    board = BoardSurface(pose(turn([0.2, -0.3, 0.1]), [-35.0, -20.0, 260.0]))
    image = light(camera, [board], None, Exposure(ambient=200.0, vignetting=0.0), np.random.default_rng(0))
    m, points = board.camera_from_board, board.points_on_board_mm()
    for u, v in camera.pixels(points @ m[:3, :3].T + m[:3, 3]):
        window = image[round(v) - 3 : round(v) + 4, round(u) - 3 : round(u) + 4]
        # A saddle point: light and dark in equal parts.
        assert window.min() < 0.35 * window.max()
        assert image[round(v), round(u)] == pytest.approx((window.min() + window.max()) / 2, rel=0.35)


def test_a_sphere_throws_a_shadow_and_hides_what_is_behind() -> None:
    camera = SimulatedCamera(**SMALL)
    wall = PlaneSurface(pose(np.eye(3), [0, 0, 330.0]))
    center = np.array([0.0, 0.0, 240.0])
    alone = light(camera, [wall], SHEET, QUIET, np.random.default_rng(0))
    both = light(camera, [SphereSurface(center, 20.0), wall], SHEET, QUIET, np.random.default_rng(0))
    row = int(alone[:, 160].argmax())
    assert alone[row, 160] > 50
    assert both[row, 160] < 1  # in the shadow
    assert both[row, 20] == pytest.approx(alone[row, 20])
    assert both[row + 10 :, 150:170].max() > 20  # the stripe on the sphere


def test_light_falls_off_and_defocus_widens() -> None:
    camera = SimulatedCamera(**SMALL)
    wall = [PlaneSurface(pose(np.eye(3), [0, 0, 330.0]))]
    rng = np.random.default_rng(0)
    even = light(camera, wall, None, Exposure(ambient=100.0, vignetting=0.0), rng)
    dimmed = light(camera, wall, None, Exposure(ambient=100.0), rng)
    np.testing.assert_allclose(dimmed / even, np.linalg.norm(camera.rays, axis=-1) ** -4, rtol=1e-9)
    sharp = light(camera, wall, SHEET, Exposure(focus_distance_mm=330.0, vignetting=0.0, speckle=0.0), rng)
    soft = light(camera, wall, SHEET, Exposure(focus_distance_mm=30.0, vignetting=0.0, speckle=0.0), rng)
    assert soft.max() < 0.8 * sharp.max()
    assert soft.sum() == pytest.approx(sharp.sum(), rel=0.02)  # the same light


def test_noise_saturation_bits_and_hot_pixels() -> None:
    flat = np.full((200, 200), 100.0)
    rng = np.random.default_rng(1)
    noisy = sense(flat, Exposure(read_noise=1.0, photon_gain=0.05, black=6.0), rng)
    assert noisy.dtype == np.uint8
    assert noisy.mean() == pytest.approx(106.0, abs=0.1)
    assert noisy.var() == pytest.approx(1 + 5 + 1 / 12, rel=0.05)
    assert sense(flat * 4, Exposure(), rng).min() == 255
    twelve = sense(flat, Exposure(bits=12), rng)
    assert twelve.dtype == np.uint16
    assert twelve.mean() == pytest.approx(106 * 16, rel=0.01)
    hot = sense(flat * 0, Exposure(hot_pixels=50), rng)
    again = sense(flat * 0, Exposure(hot_pixels=50), rng)
    assert 40 <= (hot > 50).sum() <= 50
    np.testing.assert_array_equal(hot > 50, again > 50)


@pytest.mark.thorough
def test_sessions_of_frames_are_the_same_for_the_same_seed_and_state_their_truth() -> None:
    few = FrameScenario("", camera_views=1, translations=1, orientations=1, knows_calibration=True)
    first, again = (SimulatedSession(*simulate_frames(few, "few", 3), None) for _ in range(2))
    assert first.files == again.files
    assert first.truth == again.truth
    assert set(FRAME_SCENARIOS) >= {"camera", "laser-plane", "frames-tcp"}
    plane = first.session.cell.known.laser_plane
    assert plane is not None
    assert plane.normal == first.truth["plane_in_camera"]["normal"]


def test_frames_of_the_sphere_give_the_tcp() -> None:
    simulated = simulate("frames-tcp-known", 2)
    measured = measure_capture(simulated.session, simulated.session.captures[0], simulated.files.__getitem__)
    assert measured.kind == "frame"
    assert measured.verdict != "fail"
    assert measured.on_sphere > 60
    result = solve_stage(simulated.session, "tcp", simulated.files.__getitem__)
    assert isinstance(result, TcpResult)
    shift = np.array(result.tool0_from_laser)[:3, 3] - np.array(simulated.truth["tool0_from_laser"])[:3, 3]
    stated = np.sqrt(np.trace(np.array(result.covariance)[3:, 3:]))
    assert np.linalg.norm(shift) < 3 * stated
    assert (
        stated < 1.5 * 0.5
    )  # 0.5 by noise alone; the scanner's own errors, always covered, cost up to half of it
