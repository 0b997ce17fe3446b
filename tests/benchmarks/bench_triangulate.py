"""Pixels to points on the plane of light, beside cv2.undistortPoints and numpy; and how exact."""

import numpy as np

from calib_core.optics.camera_model import CameraModel
from calib_core.optics.triangulate import ProfileCalibration
from tests.benchmarks.harness import Row, interleaved_medians_s

MATRIX = np.array([[1450.0, 0, 639.5], [0, 1452.0, 511.5], [0, 0, 1]])
DISTORTION = np.array([-0.11, 0.09, 0.0004, -0.0003, 0.01])


def run(full: bool) -> list[Row]:
    """Return time per point of both and their ratio, a frame's points and a sweep's, and the largest error."""
    camera = CameraModel(MATRIX, DISTORTION, "plain", (1280, 1024))
    calibration = ProfileCalibration.of(camera, [0.02, np.cos(0.5), np.sin(0.5)], 150.0)
    rows: list[Row] = []
    _handle_a_frame()
    for what, count, rounds in (("a frame's 1280 points", 1280, 201), ("20 000 points", 20_000, 41)):
        pixels = np.random.default_rng(1).uniform([0, 0], [1279, 1023], (count, 2))
        jobs = {"ours": lambda p=pixels: calibration.points(p), "peer": lambda p=pixels: _peer(p, calibration)}
        times = interleaved_medians_s(jobs, rounds if full else rounds // 4)
        ours, theirs = times["ours"] / count * 1e9, times["peer"] / count * 1e9
        rows += [
            Row(f"undistort and triangulate {what}", "", f"{ours:.1f} ns a point"),
            Row("  cv2.undistortPoints + numpy plane", "", f"{theirs:.1f} ns a point"),
            Row("  times faster", "≥ 12", f"{theirs / ours:.1f}", theirs / ours >= 12),
        ]
    pixels = np.random.default_rng(2).uniform([0, 0], [1279, 1023], (20_000, 2))
    error = float(np.abs(calibration.points(pixels) - _exact(pixels, calibration)).max()) * 1e3
    return [
        *rows,
        Row("largest difference from an exact iteration", "≤ 0.02 µm", f"{error:.1e} µm", error <= 0.02),
    ]


def _handle_a_frame() -> None:
    """Take and free a frame's memory, as any process that has points to triangulate did.

    The C library then keeps freed memory for the next array instead of giving it back to the system each time.
    """
    np.ones((1024, 1280), np.float32)


def _peer(pixels: np.ndarray, calibration: ProfileCalibration) -> np.ndarray:
    import cv2

    frame = calibration.camera_from_laser
    rays = cv2.undistortPoints(pixels[:, None], MATRIX, DISTORTION)[:, 0]
    rays = np.column_stack([rays, np.ones(len(rays))])
    points = rays * (calibration.distance_mm / (rays @ calibration.normal))[:, None]
    return (points - frame.translation_mm) @ frame.rotation


def _exact(pixels: np.ndarray, calibration: ProfileCalibration) -> np.ndarray:
    """Return the points by an iteration of its own, run to the last digit."""
    k1, k2, p1, p2, k3 = DISTORTION
    bent = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(MATRIX).T
    xd, yd = bent[:, 0], bent[:, 1]
    x, y = xd.copy(), yd.copy()
    for _ in range(200):
        s = x * x + y * y
        radial = 1 + s * (k1 + s * (k2 + s * k3))
        x, y = (
            (xd - 2 * p1 * x * y - p2 * (s + 2 * x * x)) / radial,
            (yd - p1 * (s + 2 * y * y) - 2 * p2 * x * y) / radial,
        )
    rays = np.column_stack([x, y, np.ones(len(x))])
    points = rays * (calibration.distance_mm / (rays @ calibration.normal))[:, None]
    return (points - calibration.camera_from_laser.translation_mm) @ calibration.camera_from_laser.rotation
