"""Ten scans of 36,000 points, and 72 of a million: processor time to the cloud with its verdict, and to the mesh.

Ten took 21 s before the merge told more than its cloud, 16 of them for the Poisson mesh; 72 took 39 and 72 s.
"""

import time
from typing import Any

import numpy as np
from harness import Row

from calib_core.records import parse_session
from calib_core.stages.pipeline import run as run_stages
from tests.merge_sets import merge_session, pcd, scan_set
from tests.vase import poses, view

BEFORE_S = 21.0
MANY_BEFORE_S = {"none": 38.7, "poisson": 71.7}


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes scans of 36,000 points and those of a million."""
    return [*of_ten(full), *(of_many() if full else [])]


def of_many() -> list[Row]:
    """Scans of a grid of a million points each, made as they are read: only what is merged is in memory."""
    points, ways = view(1000).reshape(1000, 1000, 3), poses(72)
    captures = [
        {"id": f"s{k:02d}", "step": "scan", "kind": "cloud", "files": [f"{k}.pcd"], "pose": way.ravel().tolist()}
        for k, way in enumerate(ways)
    ]
    cell: dict[str, Any] = {"pose_convention": "matrix", "known": {"tool0_from_laser": np.eye(4).tolist()}}
    seconds: dict[str, float] = {}
    for mesh in MANY_BEFORE_S:
        merge = {"merge": {"voxel_mm": 0.5, "mesh": mesh}}
        record = {"format": "scancell-session/1", "name": "vase", "cell": cell | merge, "captures": captures}
        made = 0.0

        def read(name: str) -> bytes:
            nonlocal made
            start = time.process_time()
            noise = np.random.default_rng(int(name.split(".")[0])).normal(0, 0.02, (1000, 1000, 1))
            content = pcd(points + noise * [0, 0, 1])
            made += time.process_time() - start
            return content

        start = time.process_time()
        run_stages(parse_session(record, "session"), read, "merge")
        seconds[mesh] = time.process_time() - start - made
    shares = {mesh: seconds[mesh] / before for mesh, before in MANY_BEFORE_S.items()}
    told = "; ".join(f"{seconds[mesh]:.0f} s ({share:.2f})" for mesh, share in shares.items())
    what = "72 scans of 1M points, processor time: to the cloud; to the Poisson mesh"
    return [Row(what, "≤ 1/2 of before", told, shares["poisson"] <= 0.5)]


def of_ten(full: bool) -> list[Row]:
    there = scan_set("bracket", 0, count=10, pitch_mm=0.27 if full else 0.54)
    points = int(np.mean([np.isfinite(scan.points_in_laser_mm).all(axis=-1).sum() for scan in there.scans]))
    record, files = merge_session(there)
    run_stages(parse_session(record, "session"), files.__getitem__, "merge")  # compiles
    seconds: dict[str, float] = {}
    for mesh in ("none", "grid", "poisson"):
        record["cell"]["merge"]["mesh"] = mesh
        start = time.process_time()
        run_stages(parse_session(record, "session"), files.__getitem__, "merge")
        seconds[mesh] = time.process_time() - start
    what = f"10 scans of {points:,} points, processor time"
    cloud, grid, poisson = seconds["none"], seconds["grid"], seconds["poisson"]
    share, mesh_share = cloud / BEFORE_S, poisson / BEFORE_S
    return [
        Row(
            f"{what}: to the cloud with its verdict",
            "≤ 1/4 of 21 s",
            f"{cloud:.1f} s ({share:.2f})",
            share <= 0.25,
        ),
        Row(
            f"{what}: to the Poisson mesh (grid)",
            "≤ 1/2 of 21 s",
            f"{poisson:.1f} s ({mesh_share:.2f}); grid {grid:.1f} s",
            mesh_share <= 0.5,
        ),
    ]
