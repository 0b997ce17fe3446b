"""Normals and stray points on a scan's own grid beside Open3D's normals and statistical outlier removal."""

import numpy as np
import open3d as o3d
from harness import Row, interleaved_medians_s

from calib_core.fusion.clean import clean_scan
from calib_core.fusion.clean_scan import KEPT
from calib_core.fusion.scan import Scan

SIGMA_MM = 0.02


def grid(side: int, stray_fraction: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Points (side, side, 3) of a waved surface with a raised disc, and which are strays (by more than 0.2 mm)."""
    rng = np.random.default_rng(0)
    x = (np.arange(side) - side / 2) * 200 / side
    X, Y = np.meshgrid(x, x)
    truth = 400 - 40 * np.exp(-(X**2 + Y**2) / 60**2) + 5 * np.sin(X / 9) * np.cos(Y / 7)
    truth = np.where(np.hypot(X - 50, Y - 50) < 20, truth + 30, truth)
    Z = truth + rng.normal(0, SIGMA_MM, truth.shape)
    stray = rng.random(Z.shape) < stray_fraction
    Z[stray] = rng.uniform(300, 450, int(stray.sum()))
    return np.stack([X, Y, Z], axis=-1).astype(np.float32), stray & (np.abs(Z - truth) > 0.2)


def open3d_clean(points: np.ndarray) -> np.ndarray:
    """Return which points (N,) Open3D keeps: normals of 30 neighbours, outliers by 20 at two deviations."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    _, kept = cloud.remove_statistical_outlier(20, 2.0)
    mask = np.zeros(len(points), dtype=bool)
    mask[np.asarray(kept)] = True
    return mask


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the million points of the target."""
    side = 1000 if full else 250
    points, stray = grid(side)
    scan = Scan("grid", points, np.eye(4)[None], SIGMA_MM)
    flat = points.reshape(-1, 3).astype(float)
    times = interleaved_medians_s(
        {"ours": lambda: clean_scan(scan), "theirs": lambda: open3d_clean(flat)}, rounds=3
    )
    ours, theirs = clean_scan(scan).verdicts == KEPT, open3d_clean(flat).reshape(stray.shape)
    ratio = times["theirs"] / times["ours"]
    recall, their_recall = (float((~kept)[stray].mean()) for kept in (ours, theirs))
    lost, their_lost = (float((~kept)[~stray].mean()) for kept in (ours, theirs))
    what = f"normals and cleaning, {side * side:,} points in a grid"
    figures = f"{ratio:.0f} × ({1e3 * times['ours']:.0f} ms, Open3D {1e3 * times['theirs']:.0f} ms)"
    return [
        Row(what, "≥ 30 × faster than Open3D", figures, ratio >= 30),
        Row(
            f"{what}: strays found",
            "no fewer than Open3D",
            f"{recall:.4f}, Open3D {their_recall:.4f} (good points lost: {lost:.1e}, Open3D {their_lost:.1e})",
            recall >= their_recall,
        ),
    ]
