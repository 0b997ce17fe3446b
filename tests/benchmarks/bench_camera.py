"""Camera calibration from boards, beside cv2.calibrateCamera and vision-calibration; what a tilted model is worth.

The package `vision-calibration` serves this benchmark alone: `pip install vision-calibration` adds its rows.
"""

import importlib.util
import time
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib_core.frames import FloatArray
from calib_core.optics.adjust import Adjusted, Adjustment, Corners, State, fit_poses, shared_vector
from calib_core.optics.board import BoardView
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_model import CameraModel, Model
from calib_core.optics.camera_start import homographies, poses_from_homographies, start_from_homographies
from calib_core.optics.triangulate import ProfileCalibration
from tests.benchmarks.harness import Row, interleaved_medians_s

SIZE = (1280, 1024)
MATRIX = np.array([[2400.0, 0, 650], [0, 2390, 500], [0, 0, 1]])
LENS = {"k1": -0.2, "k2": 0.12, "p1": 0.001, "p2": -0.0007, "k3": 0.02}
SCHEIMPFLUG = {"k1": -0.2, "k2": 0.12, "p1": 0.0002, "p2": -0.0001, "tauX": 0.10, "tauY": -0.04}
BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(9)]) * 12.0
WHOLE = (np.array([-np.inf]), np.array([np.inf]))


def run(full: bool) -> list[Row]:
    """Return times and optimum on 100 views, and a tilted camera's held-out errors over 300 mm of depth."""
    rows = [*_adjustment(15 if full else 7), *_tilted(40 if full else 30)]
    if importlib.util.find_spec("vision_calibration") is None:
        return [*rows, Row("vision-calibration", "", "not installed")]
    plain, tilted = CameraModel.from_names(MATRIX, LENS, SIZE), CameraModel.from_names(MATRIX, SCHEIMPFLUG, SIZE)
    return [*rows, *_beside_peer("plain", plain, 20, 0.1), *_beside_peer("tilted", tilted, 20, 0.05)]


def _adjustment(rounds: int) -> list[Row]:
    import cv2

    views = _views(CameraModel.from_names(MATRIX, LENS, SIZE), 100, 0, 0.1)
    corners = Corners.of([v.points_px for v in views], [BOARD] * 100, 0.1)
    boards = [BOARD.astype(np.float32)] * 100
    pixels = [v.points_px.astype(np.float32)[:, None] for v in views]

    def ours() -> Adjusted:
        return Adjustment(corners, *WHOLE, np.arange(9)).solve(start_from_homographies(corners, SIZE))

    def peer():
        return cv2.calibrateCamera(boards, pixels, SIZE, np.eye(3), np.zeros(5))

    def whole() -> object:
        return calibrate_camera(views, SIZE, CameraOptions(model="plain"))

    times = interleaved_medians_s({"ours": ours, "peer": peer, "whole": whole}, rounds)
    rms = float(np.sqrt((ours().corner_residuals ** 2).sum(axis=1).mean()))
    theirs = float(peer()[0])
    ratio = times["peer"] / times["ours"]
    return [
        Row("cv2.calibrateCamera, 100 views", "", f"{times['peer'] * 1e3:.0f} ms, RMS {theirs:.6f} px"),
        Row("board adjustment with covariance, 100 views", "", f"{times['ours'] * 1e3:.1f} ms, RMS {rms:.6f} px"),
        Row("times faster", "≥ 5", f"{ratio:.1f}", ratio >= 5),
        Row("same optimum: RMS differs by", "≤ 1e-5 px", f"{abs(rms - theirs):.1e} px", abs(rms - theirs) <= 1e-5),
        Row("with rejection of views and corners", "", f"{times['whole'] * 1e3:.0f} ms"),
    ]


def _tilted(count: int) -> list[Row]:
    truth = CameraModel.from_names(MATRIX, SCHEIMPFLUG, SIZE)
    views, fresh = _views(truth, count, 1, 0.02), _views(truth, 10, 2, 0.0)
    models: tuple[Model, ...] = ("plain", "tilted", "segmental")
    cameras = {model: calibrate_camera(views, SIZE, CameraOptions(model=model)).camera for model in models}
    errors = {model: _held_out_rms_px(camera, fresh) for model, camera in cameras.items()}
    step_um = largest_step_um(cameras["segmental"])
    chosen = calibrate_camera(views, SIZE).camera.model
    ratio = errors["plain"] / errors["tilted"]
    return [
        Row("tilted camera over 300 mm, held out", "", ", ".join(f"{m} {e:.4f} px" for m, e in errors.items())),
        Row("model chosen by held-out error", "tilted", chosen, chosen == "tilted"),
        Row("times smaller than the plain model's", "≥ 5", f"{ratio:.1f}", ratio >= 5),
        Row("largest step of the surface at a band's edge", "≤ 2 µm", f"{step_um:.1e} µm", step_um <= 2),
    ]


def largest_step_um(camera: CameraModel) -> float:
    """Return how far points jump where a segmental camera's bands of depth begin and end, µm.

    A pixel's thousandth on either side of each edge is compared with the thousandths beside: what is not even is a
    step.
    """
    normal, distance_mm = np.array([0.0, np.cos(0.5), np.sin(0.5)]), 260.0
    light = ProfileCalibration.of(camera, normal, distance_mm)
    largest = 0.0
    for depth in {end for s in camera.segments for end in (s.near_mm, s.far_mm)}:
        x = np.linspace(-0.1, 0.1, 21) * depth
        edge = np.column_stack(
            [x, np.full_like(x, (distance_mm - normal[2] * depth) / normal[1]), np.full_like(x, depth)]
        )
        pixels = camera.project(edge)
        around = [light.points(pixels + np.array([0.0, 1e-3 * k])) for k in (-2, -1, 1, 2)]
        beside = (around[1] - around[0] + around[3] - around[2]) / 2
        largest = max(largest, float(np.linalg.norm(around[2] - around[1] - 2 * beside, axis=1).max()))
    return 1e3 * largest


def _beside_peer(model: Model, truth: CameraModel, count: int, sigma_px: float) -> list[Row]:
    """Return held-out errors and times of both on the same detections; ours with rejection and covariance."""
    views, fresh = _views(truth, count, 3, sigma_px), _views(truth, 10, 2, 0.0)
    options = CameraOptions(model=model)
    calibrate_camera(views, SIZE, options)
    start = time.perf_counter()
    ours = calibrate_camera(views, SIZE, options).camera
    middle = time.perf_counter()
    theirs = _peer_camera(views, model)
    ratio = (time.perf_counter() - middle) / (middle - start)
    error, peer = _held_out_rms_px(ours, fresh), _held_out_rms_px(theirs, fresh)
    return [
        Row(f"vision-calibration, {model}: held out", f"≤ {peer:.5f} px", f"{error:.5f} px", error <= 1.01 * peer),
        Row(f"vision-calibration, {model}: times faster", "≥ 2", f"{ratio:.1f}", ratio >= 2),
    ]


def _peer_camera(views: list[BoardView], model: Model) -> CameraModel:
    """Return what vision-calibration makes of the views, with the same coefficients free."""
    import vision_calibration as peer  # pyright: ignore[reportMissingImports]

    data = peer.PlanarDataset(
        views=[
            peer.PlanarView(
                observation=peer.Observation(
                    points_3d=[tuple(p) for p in v.points_in_board_mm.tolist()],
                    points_2d=[tuple(p) for p in v.points_px.tolist()],
                )
            )
            for v in views
        ]
    )
    if model == "tilted":
        config = peer.ScheimpflugIntrinsicsCalibrationConfig(fix_scheimpflug={"tilt_x": False, "tilt_y": False})
        config.fix_poses = []
        run_peer = peer.run_scheimpflug_intrinsics
    else:
        config = peer.PlanarCalibrationConfig()
        run_peer = peer.run_planar_intrinsics
    config.init.fix_k3 = False
    config.fix_camera.distortion.update(k3=False)
    camera = run_peer(data, config).camera
    k, d = camera.intrinsics, camera.distortion
    names = {"k1": d.k1, "k2": d.k2, "k3": d.k3, "p1": d.p1, "p2": d.p2}
    if model == "tilted":
        names |= {"tauX": camera.sensor.tilt_x, "tauY": camera.sensor.tilt_y}
    return CameraModel.from_names([[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]], names, SIZE)


def _views(camera: CameraModel, count: int, seed: int, sigma_px: float) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    views: list[BoardView] = []
    while len(views) < count:
        r = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix()
        z = rng.uniform(300, 600)
        t = np.array([rng.uniform(-0.15, 0.15) * z, rng.uniform(-0.12, 0.12) * z, z]) - r @ BOARD.mean(0)
        pixels = camera.project(BOARD @ r.T + t)
        if (pixels > 0).all() and (pixels < SIZE).all():
            noisy = pixels + rng.normal(0, sigma_px, pixels.shape)
            views.append(BoardView(noisy, BOARD, np.arange(len(BOARD)), SIZE, sigma_px))
    return views


def _held_out_rms_px(camera: CameraModel, views: list[BoardView]) -> float:
    corners = Corners.of([v.points_px for v in views], [BOARD] * len(views))
    rays: FloatArray = camera.undistort(corners.pixels, 450.0)
    flat = replace(corners, pixels=rays)
    bands, nears, fars = camera.bands
    start = State(
        shared_vector(camera.camera_matrix, bands), *poses_from_homographies(homographies(flat), np.eye(3))
    )
    residuals = fit_poses(corners, start, (nears, fars), np.inf).corner_residuals
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))
