"""Corners fitted to the grey values: as exact as the noise lets them be, and left alone where they cannot be."""

import cv2
import numpy as np
import pytest
from scipy.special import erf

from calib_core.kernels.corner import first_fits, fit_corners
from calib_core.optics.board import find_board
from calib_core.optics.board_corners import fitted_corners
from calib_core.optics.board_refusal import grey_eight_bit
from calib_core.records import Board
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, LightSheet, light, render, sense
from calib_core.simulation.motion import pose, turn

CAMERA = SimulatedCamera()
BOARD = Board(kind="chessboard", columns=9, rows=6, pitch_mm=9.0)
NORMAL = np.array([0.0, np.cos(0.5), np.sin(0.5)])


def placed(rotation: list[float], depth_mm: float = 240.0) -> BoardSurface:
    return BoardSurface(pose(turn(rotation), [-32.0, -20.0, depth_mm]), pitch_mm=9.0)


def truth(board: BoardSurface) -> np.ndarray:
    """Corners as the camera puts them, in the order that the board's colours give."""
    m = board.camera_from_board
    return CAMERA.pixels(board.points_on_board_mm() @ m[:3, :3].T + m[:3, 3])[::-1]


def fitted(grey: np.ndarray, starts: np.ndarray, angles: np.ndarray, radius_px: float) -> np.ndarray:
    """Corners as the kernel fits them in even light: place, standard deviations and blur."""
    radii = np.full(len(starts), radius_px)
    first, out = np.empty((len(starts), 10)), np.empty((len(starts), 5))
    first_fits(grey, starts, angles, radii, first)
    fit_corners(grey, starts, radii, first, np.zeros((len(starts), 2)), out)
    return out


@pytest.mark.parametrize("rotation", [[0.3, -0.2, 0.1], [-0.4, 0.3, 0.5], [0.0, 0.0, 0.0]])
def test_corners_are_as_exact_as_the_noise_allows(rotation: list[float]) -> None:
    board = placed(rotation)
    image = render(CAMERA, [board], None, Exposure(ambient=190.0, hot_pixels=80), np.random.default_rng(4))
    view = find_board(image, BOARD)
    error = view.points_px - truth(board)[view.ids]
    # An edge of contrast h blurred by w says 2 h² / (√π w) per pixel of its length; two edges of some 12 pixels.
    assert len(view.ids) == 54
    assert np.sqrt(np.mean(error**2)) < 0.008
    assert np.abs(error.mean(axis=0)).max() < 0.003  # nothing common to the board


def test_light_that_falls_off_to_the_border_draws_no_corner_to_the_middle() -> None:
    shrunk = []
    for rotation in ([0.3, -0.2, 0.1], [-0.4, 0.3, 0.5], [0.0, 0.1, 0.0]):
        board = placed(rotation)
        still = Exposure(ambient=190.0, read_noise=0.0, photon_gain=0.0, bits=16)
        view = find_board(render(CAMERA, [board], None, still, np.random.default_rng(0)), BOARD)
        expected = truth(board)[view.ids]
        from_middle = expected - expected.mean(axis=0)
        shrunk.append(((view.points_px - expected) * from_middle).sum() / (from_middle**2).sum())
    # A contrast held even would shrink boards by 1.8e-5; what is left is lines bent by the lens.
    assert np.abs(shrunk).max() < 0.7e-5


def test_how_light_falls_off_is_not_read_from_the_noise_about_one_corner() -> None:
    board = placed([0.3, -0.2, 0.1])
    exposure = Exposure(ambient=60.0, read_noise=2.5, blur_px=1.5, blur_per_mm=0.0)
    across = np.linspace(1.0, 0.4, CAMERA.width)  # as beside a window
    room = light(CAMERA, [board], None, exposure, np.random.default_rng(0))
    off = []
    for lamp in (np.ones(CAMERA.width), across):
        frames = [sense(room * lamp, exposure, np.random.default_rng(k)) for k in range(16)]
        found = [fitted_corners(grey_eight_bit(frame), truth(board).reshape(6, 9, 2)) for frame in frames]
        off.append([corners.points_px - truth(board) for corners in found if corners is not None])
    even, falling = np.array(off)
    # 2 h² / (√π w) a pixel of two edges' length: 0.047 px; were the fall read from each window 0.054.
    assert np.sqrt(np.mean(even**2)) < 0.0505
    # A contrast held even would draw the whole board by 0.012 px.
    assert np.abs(falling.mean(axis=(0, 1))).max() < 0.006


def test_the_stated_standard_deviation_is_true() -> None:
    rng = np.random.default_rng(1)
    v, u = np.mgrid[0:24, 0:24]
    ratios = []
    for _ in range(200):
        place, angles = rng.uniform(11, 12, 2), np.array([0.3, 1.7]) + rng.uniform(-0.3, 0.3, 2)
        a, b = ((u - place[0]) * np.cos(t) + (v - place[1]) * np.sin(t) for t in angles)
        grey = 110 + 0.4 * u + 80 * erf(a) * erf(b) + rng.normal(0, 3.0, u.shape)
        start = place + rng.uniform(-0.4, 0.4, 2)
        out = fitted(grey, start[None], angles[None] + 0.05, 7.0)
        ratios.append((out[0, :2] - place) / out[0, 2])
        assert out[0, 3] == pytest.approx(3.0 / 160, rel=0.5)
        assert out[0, 4] == pytest.approx(1 / np.sqrt(2), rel=0.2)
    # 400 χ² of one degree: their mean lies within 1 ± 3.3 √(2 / 400).
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.24)


def test_sharpened_frames_keep_the_detectors_corners() -> None:
    board = placed([0.3, -0.2, 0.1])
    image = render(CAMERA, [board], None, Exposure(ambient=150.0, blur_px=0.35), np.random.default_rng(4))
    soft = image.astype(float)
    sharpened = np.clip(soft + 1.2 * (soft - cv2.GaussianBlur(soft, (0, 0), 1.0)), 0, 255).astype(np.uint8)
    assert fitted_corners(sharpened, truth(board).reshape(6, 9, 2)) is None
    assert len(find_board(sharpened, BOARD).ids) == 54


def test_corners_under_the_stripe_are_left_out_and_said() -> None:
    board = placed([0.15, -0.1, 0.05])
    sheet = LightSheet(NORMAL, 120.0, 120.0 * NORMAL)
    exposure = Exposure(ambient=90.0)
    image = render(CAMERA, [board], sheet, exposure, np.random.default_rng(4))
    view = find_board(image, BOARD)
    error = np.abs(view.points_px - truth(board)[view.ids]).max(axis=1)
    assert 36 <= len(view.ids) < 54
    assert error.max() < 0.05
    assert view.left_out == 54 - len(view.ids)


def test_a_corner_at_the_border_or_without_contrast_does_not_settle() -> None:
    flat = np.full((30, 30), 90.0)
    out = fitted(flat, np.array([[15.0, 15.0], [0.2, 0.1]]), np.tile([0.1, 1.6], (2, 1)), 6.0)
    assert np.isnan(out[:, 0]).all()
