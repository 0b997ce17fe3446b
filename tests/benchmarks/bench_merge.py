"""Voxel fusion beside Open3D (transform, append, voxel_down_sample): time, extra memory, occupied voxels."""

import gc
import resource
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import open3d as o3d
from harness import Row

from calib_core.fusion.merge import VoxelGrid
from calib_core.kernels.fusion import pack_keys
from tests.vase import poses, view

VOXEL_MM = 0.5


def peak_of(job: Callable[[], object]) -> tuple[float, float, object]:
    """Return seconds, extra peak memory in MB, and what the job returned (Linux: the peak is reset before)."""
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")
    before = status_mb("VmRSS")
    start = time.perf_counter()
    result = job()
    seconds = time.perf_counter() - start
    return seconds, status_mb("VmHWM") - before, result


def status_mb(field: str) -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field + ":"):
            return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def fused(points: np.ndarray, ways: list[np.ndarray], origin: np.ndarray) -> VoxelGrid:
    grid = VoxelGrid(VOXEL_MM, origin)
    for way in ways:
        grid.add(points, way[None])
    return grid


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 72 scans of a million points of the target."""
    count, side = (72, 1000) if full else (12, 200)
    points, ways = view(side), poses(count)
    theirs_scan = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.reshape(-1, 3).astype(float)))
    origin = np.array([-120.0, -120.0, -120.0])

    def ours() -> VoxelGrid:
        return fused(points, ways, origin)

    def theirs() -> o3d.geometry.PointCloud:
        merged = o3d.geometry.PointCloud()
        for way in ways:
            merged += o3d.geometry.PointCloud(theirs_scan).transform(way)
        return merged.voxel_down_sample(VOXEL_MM)

    fused(points[:10], ways[:1], origin)  # compiles
    rounds = 3 if full else 1
    ours_runs = [peak_of(ours) for _ in range(rounds)]
    theirs_runs = [peak_of(theirs) for _ in range(rounds)]
    seconds, their_seconds = (min(r[0] for r in runs) for runs in (ours_runs, theirs_runs))
    memory, their_memory = (min(r[1] for r in runs) for runs in (ours_runs, theirs_runs))
    ratio = their_seconds / seconds
    what = f"merge {count} × {side * side:,} points, {VOXEL_MM} mm"
    figures = f"{ratio:.1f} × ({seconds:.2f} s, Open3D {their_seconds:.2f} s)"
    rows = [
        Row(f"{what}: time", "≥ 8 × faster than Open3D", figures, ratio >= 8),
        Row(
            f"{what}: extra memory",
            "≤ 1/4 of Open3D's",
            f"{memory / their_memory:.3f} ({memory:.0f} MB, Open3D {their_memory:.0f} MB)",
            memory <= their_memory / 4,
        ),
    ]
    return [*rows, same_voxels(what, points, ways, theirs_runs[0][2])]


def same_voxels(what: str, points: np.ndarray, ways: list[np.ndarray], thinned: o3d.geometry.PointCloud) -> Row:
    """Compare with Open3D's voxels, whose corner lies half a voxel below the lowest coordinates."""
    low = np.full(3, np.inf)
    for way in ways:
        moved = points.reshape(-1, 3).astype(float) @ way[:3, :3].T + way[:3, 3]
        low = np.minimum(low, moved.min(axis=0))
    corner = low - VOXEL_MM / 2
    keys = fused(points, ways, corner).cloud().keys
    voxels = np.floor((np.asarray(thinned.points) - corner) / VOXEL_MM).astype(np.int64)
    differ = len(np.setxor1d(keys, pack_keys(voxels)))
    figures = f"{len(keys):,} voxels, {differ} differ"
    return Row(f"{what}: occupied voxels", "the same", figures, differ == 0)
