"""Registration of scans to each other beside Open3D's multiway one: places that are left wrong, and the time.

Where the package `small_gicp` is installed (`pip install small_gicp`), beside a pose graph of its pairs, too.  All
begin with the same scans and the same wrong poses; the truth is where the scanner stood.  One rigid move of all
scans together is left free, as nothing in the scans tells it.
"""

import importlib.util
import time
from collections.abc import Callable
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import open3d as o3d
from harness import Row

from calib_core.fusion.clean import clean_scan
from calib_core.fusion.clean_scan import KEPT
from calib_core.fusion.overlap import joined_patches, seen_by
from calib_core.fusion.register import register
from calib_core.fusion.scan import Scan
from calib_core.fusion.scatter import scatter
from tests.merge_sets import ScanSet, scan_set

VOXEL_MM = 1.0
FAR_MM = 0.5 * VOXEL_MM


def ours(scans: list[Scan]) -> np.ndarray:
    """Moves (S, 4, 4) of the scans."""
    seen = joined_patches([(scan.name, seen_by(clean_scan(scan), 3 * VOXEL_MM)) for scan in scans], 3 * VOXEL_MM)
    found = scatter(seen)
    registration = register(found.for_registration(seen) if found else seen, found.errors if found else None)
    assert registration is not None
    return registration.turntable_from_scan


Pairs = Callable[[list[Any]], Callable[[int, int], np.ndarray]]
"""Gives, of clouds, the way by which one of them is moved onto another, (4, 4)."""


def point_to_plane(clouds: list[Any]) -> Callable[[int, int], np.ndarray]:
    """Pairs by Open3D's ICP, point to plane."""
    reg = o3d.pipelines.registration
    for cloud in clouds:
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(3 * VOXEL_MM, 30))
    plane = reg.TransformationEstimationPointToPlane()
    return lambda one, other: (
        reg.registration_icp(clouds[one], clouds[other], FAR_MM, np.eye(4), plane).transformation
    )


def generalised(clouds: list[Any]) -> Callable[[int, int], np.ndarray]:
    """Pairs by small_gicp's generalised ICP, each cloud prepared once."""
    import small_gicp

    known = [small_gicp.preprocess_points(np.asarray(cloud.points), downsampling_resolution=0.5 * VOXEL_MM)
             for cloud in clouds]  # fmt: skip

    def moved(one: int, other: int) -> np.ndarray:
        (target, tree), (source, _) = known[other], known[one]
        return small_gicp.align(target, source, tree, max_correspondence_distance=FAR_MM).T_target_source

    return moved


def theirs(scans: list[Scan], pairs_of: Pairs) -> np.ndarray:
    """Moves by every pair that overlaps, and a pose graph, as Open3D's tutorial has it."""
    reg = o3d.pipelines.registration
    clouds = []
    for scan in scans:
        kept = clean_scan(scan)
        points = kept.points_in_turntable_mm[kept.verdicts == KEPT].astype(float)
        clouds.append(o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(VOXEL_MM))
    moved = pairs_of(clouds)
    graph = reg.PoseGraph()
    for _ in clouds:
        graph.nodes.append(reg.PoseGraphNode(np.eye(4)))
    pairs = [
        (reg.evaluate_registration(clouds[one], clouds[other], FAR_MM, np.eye(4)).fitness, one, other)
        for one, other in combinations(range(len(clouds)), 2)
    ]
    group = list(range(len(clouds)))
    for fitness, one, other in sorted(pairs, reverse=True):  # the best that hang all together are certain
        if fitness < 0.1:
            continue
        found = moved(one, other)
        known = reg.get_information_matrix_from_point_clouds(clouds[one], clouds[other], FAR_MM, found)
        certain = group[one] != group[other]
        group = [group[one] if k == group[other] else k for k in group]
        graph.edges.append(reg.PoseGraphEdge(one, other, found, known, uncertain=not certain))
    reg.global_optimization(
        graph,
        reg.GlobalOptimizationLevenbergMarquardt(),
        reg.GlobalOptimizationConvergenceCriteria(),
        reg.GlobalOptimizationOption(FAR_MM, 0.25, reference_node=0),
    )
    return np.array([node.pose for node in graph.nodes])


def left_mm(there: ScanSet, moves: np.ndarray) -> float:
    """RMS distance of the scans' points from where they truly are, one rigid move of all taken off."""
    is_at, true = [], []
    for scan, move, actual, reported in zip(there.scans, moves, there.actual, there.reported, strict=True):
        points = scan.points_in_laser_mm.astype(float)
        in_t = np.einsum("pij,pcj->pci", scan.turntable_from_laser[:, :3, :3], points)
        in_t += scan.turntable_from_laser[:, None, :3, 3]
        known = in_t[np.isfinite(in_t).all(axis=-1)][::50]
        is_at.append(known @ move[:3, :3].T + move[:3, 3])
        right = actual @ np.linalg.inv(reported)
        true.append(known @ right[:3, :3].T + right[:3, 3])
    a, b = np.concatenate(is_at), np.concatenate(true)
    u, _, vt = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    off = (a - a.mean(axis=0)) @ turn.T - (b - b.mean(axis=0))
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes three seeds."""
    peers: dict[str, Callable[[list[Scan]], np.ndarray]] = {
        "Open3D's multiway": partial(theirs, pairs_of=point_to_plane)
    }
    if importlib.util.find_spec("small_gicp") is not None:
        peers["small_gicp's pairs"] = partial(theirs, pairs_of=generalised)
    squares, seconds = [], []
    for seed in range(3 if full else 1):
        there = scan_set(
            "bracket", seed, pitch_mm=0.7, position_sigma_mm=0.1, orientation_sigma_rad=4e-4, alike=0.0
        )
        row, took = [left_mm(there, np.tile(np.eye(4), (len(there.scans), 1, 1)))], []
        ours(there.scans[:2])  # compiles
        for way in (ours, *peers.values()):
            start = time.process_time()
            moves = way(there.scans)
            took.append(time.process_time() - start)
            row.append(left_mm(there, moves))
        squares.append(np.square(row))
        seconds.append(took)
    before, mine, *others = np.sqrt(np.mean(squares, axis=0)).tolist()
    own, *theirs_s = np.mean(seconds, axis=0).tolist()
    what = f"12 scans of a bracket registered, {len(squares)} seed{'s' if len(squares) > 1 else ''}"
    rows: list[Row] = []
    for name, other, peer in zip(peers, others, theirs_s, strict=True):
        figures = f"{mine / other:.2f} × ({mine:.3f} beside {other:.3f} mm; {before:.3f} before)"
        rows.append(Row(f"{what}: places left wrong beside {name}", "≤ 1.0 ×", figures, mine <= other))
        figures = f"{peer / own:.1f} × ({own:.1f} s)"
        rows.append(Row(f"{what}: processor time beside {name}", "≥ 3 ×", figures, peer >= 3 * own))
    return rows
