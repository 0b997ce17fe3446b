"""The plane of light beside the package vision-calibration: the same corners and stripe centres given to both.

The package serves this benchmark alone: `pip install vision-calibration` adds its rows.  Real sets are read from
`../shared/data` where they are.
"""

import importlib.util
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from harness import Row
from scipy.spatial.transform import Rotation

from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.optics.board import BoardView
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_layout import parameter_places
from calib_core.optics.camera_model import CameraModel, Model
from calib_core.optics.laser_plane import points_on_board
from calib_core.optics.laser_plane_joint import CameraUncertainty
from calib_core.optics.laser_plane_solve import PlaneView, board_poses, solve_plane
from calib_core.optics.stripe import StripeCenters
from calib_core.optics.triangulate import ProfileCalibration

_SIZE = (1280, 1024)
_MATRIX = np.array([[2400.0, 0, 650], [0, 2390, 500], [0, 0, 1]])
_LENS = {"k1": -0.2, "k2": 0.12, "p1": 0.001, "p2": -0.0007, "k3": 0.02}
_TILTED = {"k1": -0.2, "k2": 0.12, "tauX": 0.10, "tauY": -0.04}
_BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(9)]) * 12.0
_NORMAL, _DISTANCE_MM = np.array([0.0, np.cos(0.5), np.sin(0.5)]), 215.0
_REAL = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "laser-plane-arm-640"
_FOLDS = 4
_SETS = 14
_TILTED_SETS = 3  # the peer loses its way with all of tilt and decentring free, slowly

Solver = Callable[[Sequence[PlaneView]], "Calibration"]


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera and a plane normal · p = distance of light in it."""

    camera: CameraModel
    normal: FloatArray
    distance_mm: float


def run(full: bool) -> list[Row]:
    """Return held-out errors and times of both, on simulated sets and on a real one."""
    if importlib.util.find_spec("vision_calibration") is None:
        return [Row("vision-calibration", "", "not installed")]
    rows = [*_simulated("plain", _LENS, 2 * _SETS if full else _SETS)]
    rows += _simulated("tilted", _TILTED, _TILTED_SETS)
    return [*rows, *_real()] if _REAL.is_dir() else rows


def _simulated(model: Model, lens: dict[str, float], count: int) -> list[Row]:
    """Return rows on sets of ten boards; the error is in space, of the stripe's points on boards not seen."""
    truth = CameraModel.from_names(_MATRIX, lens, _SIZE)
    pixels = np.concatenate(
        [view.stripe.pixels for view in [*_views(truth, 1000, 0, 0), *_views(truth, 1001, 0, 0)]]
    )
    exact = ProfileCalibration.of(truth, _NORMAL, _DISTANCE_MM)
    fresh = exact.camera_from_laser.apply(exact.points(pixels))
    errors: dict[str, list[float]] = {"ours": [], "peer": []}
    times: dict[str, list[float]] = {"ours": [], "peer": []}
    solvers: dict[str, Solver] = {"ours": lambda v: ours(v, model), "peer": lambda v: peer(v, model)}
    ours(_views(truth, 99), model)
    for seed in range(count):
        views = _views(truth, seed)
        for name, solve in solvers.items():
            start = time.perf_counter()
            found = solve(views)
            times[name].append(time.perf_counter() - start)
            seen = ProfileCalibration.of(found.camera, found.normal, found.distance_mm)
            in_camera = seen.camera_from_laser.apply(seen.points(pixels))
            errors[name].append(float(np.mean(np.sum((in_camera - fresh) ** 2, axis=1))))
    return _rows(f"{model}, {count} simulated sets", errors, times)


def _real() -> list[Row]:
    """Return rows on a camera and line on an arm; the error is the distance to the plane on left-out boards."""
    views = _real_views()
    errors: dict[str, list[float]] = {"ours": [], "peer": []}
    times: dict[str, list[float]] = {"ours": [], "peer": []}
    solvers: dict[str, Solver] = {"ours": lambda v: ours(v, "plain"), "peer": lambda v: peer(v, "plain")}
    for fold in range(_FOLDS):
        kept = [view for index, view in enumerate(views) if index % _FOLDS != fold]
        for name, solve in solvers.items():
            start = time.perf_counter()
            found = solve(kept)
            times[name].append(time.perf_counter() - start)
            errors[name] += [_off_plane_mm2(found, view) for view in views[fold::_FOLDS]]
    return _rows(f"{len(views)} real boards, {_FOLDS} folds", errors, times)


def _rows(what: str, errors: dict[str, list[float]], times: dict[str, list[float]]) -> list[Row]:
    ours_mm, peer_mm = (float(np.sqrt(np.mean(errors[name]))) for name in ("ours", "peer"))
    ratio = float(np.median(np.array(times["peer"]) / np.array(times["ours"])))
    return [
        Row(
            f"laser plane, {what}: held out", f"≤ {peer_mm:.4f} mm", f"{ours_mm:.4f} mm", ours_mm <= 1.01 * peer_mm
        ),
        Row(f"laser plane, {what}: times faster", "≥ 2", f"{ratio:.1f}", ratio >= 2),
    ]


def ours(views: Sequence[PlaneView], model: Model) -> Calibration:
    """Return camera and plane with their covariance, the camera's carried into the plane's."""
    solution = calibrate_camera([v.board for v in views], views[0].board.image_size, CameraOptions(model=model))
    uncertainty = CameraUncertainty(parameter_places(solution.parameters), solution.covariance, ())
    plane = solve_plane(solution.camera, views, uncertainty)
    return Calibration(plane.camera, plane.normal, plane.distance_mm)


def peer(views: Sequence[PlaneView], model: Model) -> Calibration:
    """Return what vision-calibration makes of the same detections, with the same coefficients free."""
    import vision_calibration as vc

    data = vc.LaserlineDataset(
        views=[
            vc.LaserlineView(
                observation=vc.Observation(
                    points_3d=[tuple(p) for p in v.board.points_in_board_mm.tolist()],
                    points_2d=[tuple(p) for p in v.board.points_px.tolist()],
                ),
                laser_pixels=[tuple(p) for p in v.stripe.pixels.tolist()],
                laser_weights=[1.0] * len(v.stripe.pixels),
            )
            for v in views
        ]
    )
    config = vc.LaserlineDeviceCalibrationConfig()
    config.init.fix_k3 = False
    config.optimize.fix_camera.distortion.update(k3=False)
    config.optimize.fix_sensor = model != "tilted"
    config.optimize.fix_poses = []
    found = vc.run_laserline_device(data, config).estimate.params
    k, d = found.intrinsics, found.distortion
    names = {"k1": d.k1, "k2": d.k2, "k3": d.k3, "p1": d.p1, "p2": d.p2}
    if model == "tilted":
        names |= {"tauX": found.sensor.tilt_x, "tauY": found.sensor.tilt_y}
    camera = CameraModel.from_names(
        [[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]], names, views[0].board.image_size
    )
    normal = np.array(found.plane.normal_xyz)
    return Calibration(camera, -normal, float(found.plane.distance))  # theirs: n · p + d = 0


def _views(camera: CameraModel, seed: int, corner_px: float = 0.05, stripe_px: float = 0.05) -> list[PlaneView]:
    """Return ten boards with the stripe on them, all of them wholly in view."""
    rng = np.random.default_rng([seed, 7])
    views: list[PlaneView] = []
    while len(views) < 10:
        rotation = Rotation.from_rotvec(rng.uniform(-0.45, 0.45, 3)).as_matrix()
        depth = rng.uniform(350, 520)
        middle = np.array([*rng.uniform(-0.08, 0.08, 2) * depth, depth])
        board = RigidTransform.of(rotation, middle - rotation @ _BOARD.mean(axis=0), "camera", "board")
        corners = camera.project(board.apply(_BOARD))
        n, d = rotation.T @ _NORMAL, _DISTANCE_MM - _NORMAL @ board.translation_mm
        x = np.linspace(0, 96, 200)
        y = (d - n[0] * x) / n[1]
        if not ((corners > 0) & (corners < _SIZE)).all() or y.min() < 2 or y.max() > 58:
            continue
        line = camera.project(board.apply(np.column_stack([x, y, np.zeros_like(x)])))
        row = line[:, 1] + rng.normal(0, stripe_px, len(x))
        sigma = np.full(len(x), stripe_px)
        stripe = StripeCenters(line[:, 0], row, sigma, sigma * 0 + 100, "columns", 2.0, 1.0)
        noisy = corners + rng.normal(0, corner_px, corners.shape)
        seen = BoardView(noisy, _BOARD, np.arange(len(_BOARD)), _SIZE, corner_px)
        views.append(PlaneView(f"l{len(views)}", seen, stripe))
    return views


def _real_views() -> list[PlaneView]:
    """Return the boards of a real set on which both board and stripe are found, the stripe's strays left out."""
    from calib_core.captures.boards import board_in, stripe_of
    from calib_core.records import parse_session

    session = parse_session(json.loads((_REAL / "session.json").read_text()))
    assert session.cell.board is not None

    def read(name: str) -> bytes:
        return (_REAL / name).read_bytes()

    views: list[PlaneView] = []
    for capture in session.captures:
        try:
            board = board_in(capture, session.cell.board, read)
            views.append(PlaneView(capture.id, board, stripe_of(capture, read)))
        except CalibrationError:
            continue  # the laser alone in the dark
    return _without_strays(views)


def _without_strays(views: list[PlaneView]) -> list[PlaneView]:
    """Return the views with those stripe centres that ours would use: the peer has no rejection of its own."""
    camera = calibrate_camera(
        [v.board for v in views], views[0].board.image_size, CameraOptions(model="plain")
    ).camera
    solution = solve_plane(camera, views)
    clean: list[PlaneView] = []
    for view, figures in zip(views, solution.views, strict=True):
        if figures.left_out is not None:
            continue
        off = _stripe_on_board(camera, view) @ solution.normal - solution.distance_mm
        clean.append(PlaneView(view.name, view.board, view.stripe.selected(np.abs(off) < 0.5)))
    return clean


def _stripe_on_board(camera: CameraModel, view: PlaneView) -> FloatArray:
    pose = board_poses(camera, [view.board])[0][0]
    return points_on_board(camera, view.stripe.pixels, pose)


def _off_plane_mm2(found: Calibration, view: PlaneView) -> float:
    off = _stripe_on_board(found.camera, view) @ found.normal - found.distance_mm
    return float(np.mean(off**2))
