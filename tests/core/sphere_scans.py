"""A sphere scanned from all around by a cell with known errors, computed apart from the code under test."""

import numpy as np

from calib_core.frames import rotation_from_vector
from calib_core.fusion.overlap import PoseErrors, move_of_pose_change
from calib_core.fusion.scan import Scan

RADIUS_MM = 20.0
CENTER_MM = np.array([15.0, -8.0, 40.0])
POINT_SIGMA_MM = 0.02


def pose(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def nominal_poses(count: int) -> list[np.ndarray]:
    """turntable_from_laser of views from all around, 200 mm from the sphere, at three elevations."""
    poses = []
    for k in range(count):
        around, up = 2 * np.pi * k / count, np.deg2rad((10, 35, 60)[k % 3])
        out = np.array([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.sin(up)])
        x = np.array([-np.sin(around), np.cos(around), 0])
        poses.append(pose(np.column_stack([x, np.cross(-out, x), -out]), CENTER_MM + 200 * out))
    return poses


def scan_sphere(name: str, actual: np.ndarray, reported: np.ndarray, pitch_mm: float, rng) -> Scan:
    """Rays along z of L on a grid; the noise is along the sphere's normal."""
    inverse = np.linalg.inv(actual)
    x, y, z = inverse[:3, :3] @ CENTER_MM + inverse[:3, 3]
    steps = np.arange(-RADIUS_MM, RADIUS_MM, pitch_mm)
    Y, X = np.meshgrid(y + steps, x + steps, indexing="ij")
    radius = RADIUS_MM + rng.normal(0, POINT_SIGMA_MM, X.shape)
    height2 = radius**2 - (X - x) ** 2 - (Y - y) ** 2
    Z = z - np.sqrt(np.where(height2 > 0, height2, np.nan))
    points = np.stack([X, Y, Z], -1).astype(np.float32)
    return Scan(name, points, reported[None], POINT_SIGMA_MM)


def scanned(
    count: int, pitch_mm: float, seed: int, common_sigma: np.ndarray, own_sigma: np.ndarray
) -> tuple[list[Scan], PoseErrors]:
    """Scans with an error of L in the tool that all share and one of each pose; both 6 sigmas (rad, mm) in L.

    Returns the scans and the errors as a calibration that knows these sigmas would state them.
    """
    rng = np.random.default_rng(seed)
    shared = rng.normal(0, 1, 6) * common_sigma
    scans, common, own = [], [], []
    for k, reported in enumerate(nominal_poses(count)):
        mine = rng.normal(0, 1, 6) * own_sigma
        error = shared + mine
        actual = reported @ pose(rotation_from_vector(error[:3]), error[3:])
        scans.append(scan_sphere(f"s{k:02d}", actual, reported, pitch_mm, rng))
        into_t = np.zeros((6, 6))
        into_t[:3, :3], into_t[3:, 3:] = np.eye(3), reported[:3, :3]
        moves = move_of_pose_change(reported, into_t)
        common.append(moves * common_sigma)
        own.append(moves @ np.diag(own_sigma**2) @ moves.T)
    return scans, PoseErrors(np.array(common), np.array(own))
