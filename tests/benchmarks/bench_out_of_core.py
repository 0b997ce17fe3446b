"""Fusion of more points than memory is meant to hold: sums go to disk by tiles; memory stays bounded."""

import sys
import time
from dataclasses import dataclass

from bench_merge import VOXEL_MM, peak_of, status_mb
from harness import Row

from calib_core.archive.spill import FileSpill
from calib_core.fusion.merge import VoxelGrid
from tests.vase import poses, view

MOST_BYTES = 150_000_000
MOST_MEMORY_MB = 1000.0


@dataclass(frozen=True)
class Fused:
    """What came out: voxels, points in them, and what it took."""

    voxels: int
    points: int
    spilled_mb: float
    spills: int


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 500 million points of the target."""
    scans, side = (500, 1000) if full else (20, 400)
    start = time.perf_counter()
    _, memory_mb, fused = peak_of(lambda: _fuse(scans, side))
    assert isinstance(fused, Fused)
    seconds = time.perf_counter() - start
    expected = scans * side * side
    return [
        Row(
            f"{expected / 1e6:.0f} M points out of core: all are in",
            f"{expected}",
            f"{fused.points}",
            fused.points == expected,
        ),
        Row(
            "  extra memory at most",
            f"≤ {MOST_MEMORY_MB:.0f} MB",
            f"{memory_mb:.0f} MB ({fused.spills} times to disk, {fused.spilled_mb:.0f} MB)",
            memory_mb <= MOST_MEMORY_MB,
        ),
        Row("  voxels; time", "", f"{fused.voxels:,}; {seconds:.1f} s"),
    ]


def _fuse(scans: int, side: int) -> Fused:
    """Fuse scans of side × side points, 72 of each object, the objects beside each other."""
    points, ways = view(side), poses(72)
    with FileSpill() as store:
        grid = VoxelGrid(VOXEL_MM, store=store, most_bytes=MOST_BYTES if side == 1000 else MOST_BYTES // 10)
        for n in range(scans):
            way = ways[n % 72].copy()
            way[:3, 3] += 300.0 * (n // 72 % 3), 300.0 * (n // 216), 0.0
            grid.add(points, way[None])
            if (n + 1) % 100 == 0:
                print(f"  {n + 1} scans, {status_mb('VmRSS'):.0f} MB now", file=sys.stderr, flush=True)
        voxels = counted = 0
        for piece in grid.clouds():
            voxels, counted = voxels + len(piece), counted + int(piece.counts.sum())
        return Fused(voxels, counted, store.bytes_written / 1e6, grid.spills)
