"""Scans by a raw camera whose stripe leaves the object: dark frames are blank rows, and all dark is said."""

import cv2
import numpy as np
import pytest

from calib_core.captures.placement import Placement
from calib_core.captures.scans import read_scan, scan_groups
from calib_core.errors import MeasurementError
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.simulation.live_camera import LiveCamera

RADIUS_MM = 20.0
CENTER_MM = np.array([3.0, 0.0, 190.0])


def stripe_on_sphere(y_mm: float) -> np.ndarray:
    """Where the plane of light, moved by y, meets the sphere, (N, 3) in L; none beside it."""
    square = RADIUS_MM**2 - y_mm**2
    if square <= 25.0:
        return np.zeros((0, 3))
    x = np.arange(-0.8, 0.8, 0.005) * np.sqrt(square)
    return np.column_stack([x + CENTER_MM[0], 0 * x, CENTER_MM[2] - np.sqrt(square - x**2)])


def scan_of(lens: LiveCamera, ys_mm: list[float]) -> np.ndarray:
    """The scan's points in the base, (profiles, columns, 3), the robot moved by each y."""
    rng = np.random.default_rng(1)
    images = [lens.image(stripe_on_sphere(y), rng) for y in ys_mm]
    files = {f"captures/s/{k}.png": cv2.imencode(".png", image)[1].tobytes() for k, image in enumerate(images)}
    poses = [RigidTransform.of([0, 0, 0], [0, y, 0], "base", "tool0").matrix.ravel().tolist() for y in ys_mm]
    capture = {"id": "s", "step": "scan", "kind": "sweep", "files": list(files), "poses": poses}
    cell = {"pose_convention": "matrix", "scanner": {"kind": "frame"}, "known": lens.known()}
    record = {"format": "scancell-session/1", "name": "x", "cell": cell, "captures": [capture]}
    session = Session.model_validate(record)
    (group,) = scan_groups(session.captures)
    tool = RigidTransform.of([0, 0, 0], [0, 0, 0], "tool0", "laser")
    scan = read_scan(session, group, Placement(tool, None), files.__getitem__)
    return scan.points_in_laser_mm + np.array(ys_mm, dtype=np.float32)[:, None, None] * [0, 1, 0]


def test_frames_before_and_after_the_object_are_blank_rows() -> None:
    lens = LiveCamera(np.random.default_rng(1))
    points = scan_of(lens, [-30.0, -12.0, -4.0, 4.0, 12.0, 30.0])
    seen = np.isfinite(points[..., 2])
    assert not seen[[0, -1]].any()
    assert (seen[1:-1].sum(axis=1) > 200).all()
    off = np.linalg.norm(points[seen] - CENTER_MM, axis=1) - RADIUS_MM
    assert np.abs(off).max() < 0.05
    assert abs(off.mean()) < 0.003


def test_a_scan_without_a_stripe_in_any_frame_is_said() -> None:
    lens = LiveCamera(np.random.default_rng(1))
    with pytest.raises(MeasurementError, match="one of the scan's frames"):
        scan_of(lens, [-30.0, 30.0])
