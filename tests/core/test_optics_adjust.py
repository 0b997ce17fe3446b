"""Bundle adjustment: its derivatives, its optimum beside OpenCV's, and whether its covariance is true."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.optics.adjust import (
    Adjustment,
    Corners,
    LaserLines,
    State,
    fit_poses,
    plane_start,
    shape_start,
    shared_vector,
)
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_start import homographies, start_from_homographies

MATRIX = np.array([[2400.0, 0, 650], [0, 2390, 500], [0, 0, 1]])
LENS = np.array([-0.2, 0.12, 0.001, -0.0007, 0.02])
SIZE = (1280, 1024)
BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(9)]) * 15
WHOLE = (np.array([-np.inf]), np.array([np.inf]))
PLAIN = np.arange(9)
Q = np.array([0.0003, 0.0079, 0.0025])  # the plane of light: through (0, 0, 400) mm, steep


def views(count: int, seed: int, sigma_px: float, camera: CameraModel) -> tuple[list[FloatArray], State]:
    rng = np.random.default_rng(seed)
    pixels: list[FloatArray] = []
    rotations, translations = [], []
    while len(pixels) < count:
        r = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix()
        t = rng.uniform([-60, -50, 300], [60, 50, 500]) - r @ BOARD.mean(0)
        p = camera.project(BOARD @ r.T + t)
        if (p > 0).all() and (p < SIZE).all():
            pixels.append(p + rng.normal(0, sigma_px, p.shape))
            rotations.append(r)
            translations.append(t)
    return pixels, State(np.zeros(0), np.array(rotations), np.array(translations))


def corners_of(pixels: list[FloatArray], sigma_px: float) -> Corners:
    return Corners.of(pixels, [BOARD] * len(pixels), sigma_px)


def two_bands() -> tuple[Adjustment, State]:
    """Everything at once: two bands, all coefficients, a bent board and laser lines; nothing at its optimum."""
    rng = np.random.default_rng(5)
    pixels, at = views(4, 5, 0.5, CameraModel(MATRIX, LENS))
    bands = np.array([
        [*LENS, 0.02, -0.01, 0.03, 0.002, -0.001, 0.003, 0.001, 0.05, -0.03],
        [*(LENS * 1.2), 0.01, 0.02, -0.03, 0.001, 0.002, -0.003, 0.002, 0.05, -0.03],
    ])  # fmt: skip
    shared = shared_vector(MATRIX, bands, Q)
    shared[shape_start(2) : shape_start(2) + 7] = rng.normal(0, 0.1, 7)
    lines = LaserLines(
        rng.uniform([200, 200], [1000, 800], (40, 2)),
        np.array([0, 1] * 20),
        np.array([0, 10, 20, 30, 40]),
        np.full(40, 5.0),
        rng.uniform(-1, 1, (40, 7)),
    )
    free = np.arange(len(shared))
    nears, fars = np.array([250.0, 380.0]), np.array([420.0, 600.0])
    return Adjustment(corners_of(pixels, 0.2), nears, fars, free, lines=lines), State(
        shared, at.rotations, at.translations
    )


def moved(state: State, parameter: int, step: float) -> State:
    shared, r, t = state.shared.copy(), state.rotations.copy(), state.translations.copy()
    if parameter < len(shared):
        shared[parameter] += step
    elif parameter < len(shared) + 3:
        r[1] = r[1] @ Rotation.from_rotvec(step * np.eye(3)[parameter - len(shared)]).as_matrix()
    else:
        t[1, parameter - len(shared) - 3] += step
    return State(shared, r, t)


def test_gradients_are_the_slopes_of_the_cost() -> None:
    adjustment, state = two_bands()
    # The lines' residuals are divided by a slope that is held in their derivative; corners alone are exact.
    corners_only = Adjustment(adjustment.corners, adjustment.band_nears, adjustment.band_fars, adjustment.free)
    count = len(state.shared)
    for parameter in [*range(count - 3), *range(count, count + 6)]:
        if parameter in (30, 31):
            continue  # the tilt is one for all bands, taken from the first
        scale = max(abs(state.shared[parameter]) if parameter < count else 1.0, 1e-2)
        step = 1e-6 * scale
        equations = corners_only.equations(state)
        up = corners_only.equations(moved(state, parameter, step)).cost
        down = corners_only.equations(moved(state, parameter, -step)).cost
        slope = (up - down) / (2 * step)
        if parameter < count:  # undo the elimination of the poses: gradient = reduced − coupling · pose step
            coupling = np.einsum("vpc,vpq,vq->c", equations.poses_by_shared, equations.h_pp, equations.pose_step)
            given = (equations.gradient + coupling)[parameter]
        else:
            given = -(equations.h_pp[1] @ equations.pose_step[1])[parameter - count]
        assert given == pytest.approx(slope, rel=2e-4, abs=1e-5 * abs(equations.cost) / scale), parameter


def test_laser_lines_have_the_slopes_they_say() -> None:
    adjustment, state = two_bands()
    count = len(state.shared)
    lines = adjustment.lines
    assert lines is not None
    # On the line itself the residual is zero and its slope is exact: put the pixels there.
    camera = CameraModel(MATRIX, LENS)
    single = shared_vector(MATRIX, np.zeros((1, 14)), Q)
    single[4:9] = LENS
    pixels = []
    for r, t in zip(state.rotations, state.translations, strict=True):
        q_board = r[:, 2] / (r[:, 2] @ t)
        e = Q - q_board
        for s in np.linspace(-0.15, 0.15, 10):
            x, y = (s, -(e[0] * s + e[2]) / e[1]) if abs(e[1]) > abs(e[0]) else (-(e[1] * s + e[2]) / e[0], s)
            pixels.append(camera.project([[x, y, 1.0]])[0])
    on_line = LaserLines(np.array(pixels), lines.axes, lines.ends, lines.weights, lines.basis)
    free = np.arange(len(single))
    exact = Adjustment(adjustment.corners.weighted(np.zeros(216)), *WHOLE, free, lines=on_line)
    state = State(single, state.rotations, state.translations)
    equations = exact.equations(state)
    assert np.abs(equations.line_residuals).max() < 1e-7
    for parameter in [
        0,
        1,
        2,
        3,
        4,
        6,
        8,
        16,
        17,
        *range(18, 25),
        plane_start(1),
        plane_start(1) + 1,
        plane_start(1) + 2,
    ]:
        step = 1e-7 if parameter >= plane_start(1) else 1e-5
        moves = exact.equations(moved(state, parameter, step)).line_residuals * lines.weights
        # half the squared move is step² / 2 times the parameter's own element of the full Hessian
        reduced = equations.hessian[parameter, parameter]
        coupling = np.einsum(
            "vp,vpq,vq->",
            equations.poses_by_shared[:, :, parameter], equations.h_pp, equations.poses_by_shared[:, :, parameter],
        )  # fmt: skip
        assert float(moves @ moves) / step**2 == pytest.approx(reduced + coupling, rel=1e-3), parameter
    assert count > len(single)


def test_the_optimum_is_opencvs() -> None:
    pixels, _ = views(15, 1, 0.1, CameraModel(MATRIX, LENS))
    corners = corners_of(pixels, 0.1)
    ours = Adjustment(corners, *WHOLE, PLAIN).solve(start_from_homographies(corners, SIZE))
    rms, matrix, lens, _, _ = cv2.calibrateCamera(
        [BOARD.astype(np.float32)] * 15,
        [p.astype(np.float32)[:, None] for p in pixels],
        SIZE,
        np.eye(3),
        np.zeros(5),
    )
    assert ours.converged
    assert np.sqrt(2 * ours.cost * 0.01 / corners.ends[-1]) == pytest.approx(rms, rel=1e-5)
    np.testing.assert_allclose(ours.state.shared[:4], matrix[[0, 1, 0, 1], [0, 1, 2, 2]], atol=0.02)
    np.testing.assert_allclose(ours.state.shared[4:8], lens.ravel()[:4], atol=1e-3)


def test_the_covariance_is_true() -> None:
    truth = np.concatenate([[2400, 2390, 650, 500], LENS])
    scores, pose_scores = [], []
    runs = 40
    for seed in range(runs):
        pixels, at = views(12, 100 + seed, 0.1, CameraModel(MATRIX, LENS))
        corners = corners_of(pixels, 0.1)
        end = Adjustment(corners, *WHOLE, PLAIN).solve(start_from_homographies(corners, SIZE))
        error = end.state.shared[:9] - truth
        scores.append(error @ np.linalg.solve(end.covariance, error))
        turn = Rotation.from_matrix(at.rotations[0].T @ end.state.rotations[0]).as_rotvec()
        off = np.concatenate([turn, end.state.translations[0] - at.translations[0]])
        pose_scores.append(off @ np.linalg.solve(end.pose_covariances[0], off))
    for values, freedom in ((scores, 9), (pose_scores, 6)):
        low, high = chi2.ppf([0.005, 0.995], freedom * runs) / runs
        assert low < np.mean(values) < high


def test_a_bent_board_is_found() -> None:
    camera = CameraModel(MATRIX, LENS)
    pixels, at = views(15, 3, 0.0, camera)
    corners = corners_of(pixels, 0.05)
    bend = np.array([0.3, 0.0, -0.2, 0, 0, 0, 0])  # mm: what a sheet of paper on thin wood does
    basis = corners.shape_basis()[: len(BOARD)]
    bent = BOARD + np.column_stack([np.zeros((len(BOARD), 2)), basis @ bend])
    rng = np.random.default_rng(3)
    seen = [
        camera.project(bent @ r.T + t) + rng.normal(0, 0.05, (len(BOARD), 2))
        for r, t in zip(at.rotations, at.translations, strict=True)
    ]
    corners = corners_of(seen, 0.05)
    start = start_from_homographies(corners, SIZE)
    flat = Adjustment(corners, *WHOLE, PLAIN).solve(start)
    free = np.concatenate([PLAIN, np.arange(shape_start(1), shape_start(1) + 7)])
    shaped = Adjustment(corners, *WHOLE, free).solve(flat.state)
    assert flat.cost > 5 * shaped.cost
    deviation = np.sqrt(np.diag(shaped.covariance))[9:]
    found = shaped.state.shared[shape_start(1) : shape_start(1) + 7]
    assert (np.abs(found - bend) < 4 * deviation).all()
    assert deviation.max() < 0.05


def test_poses_alone() -> None:
    pixels, at = views(5, 4, 0.1, CameraModel(MATRIX, LENS))
    shared = shared_vector(MATRIX, np.array([[*LENS, *([0.0] * 9)]]))
    start = State(shared, at.rotations, at.translations + 5.0)
    end = fit_poses(corners_of(pixels, 0.1), start, WHOLE, np.inf)
    error = end.state.translations - at.translations
    deviation = np.sqrt(np.einsum("vii->vi", end.pose_covariances))[:, 3:]
    assert (np.abs(error) < 4.5 * deviation).all()


def test_rays_that_are_missing_do_not_spoil_a_homography() -> None:
    pixels, _ = views(3, 6, 0.0, CameraModel(MATRIX))
    whole = homographies(corners_of(pixels, 1.0))
    pixels[1][5] = np.nan
    holed = homographies(corners_of(pixels, 1.0))
    ratio = holed / whole
    np.testing.assert_allclose(ratio, ratio[:, :1, :1] * np.ones((3, 3, 3)), rtol=1e-5)


def test_boards_that_all_face_the_camera_say_nothing() -> None:
    camera = CameraModel(MATRIX)
    corners = corners_of([camera.project(BOARD + np.array([-60.0, -40.0, z])) for z in (300.0, 350.0, 400.0)], 0.1)
    with pytest.raises(MotionError, match="tilted"):
        start_from_homographies(corners, SIZE)
