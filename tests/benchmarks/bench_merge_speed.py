"""Ten scans of 36,000 points: processor time to the cloud with its verdict, and to the mesh.

The whole took 21 s before the merge told more than its cloud, 16 of them for the Poisson mesh.
"""

import time

import numpy as np
from harness import Row

from calib_core.records import parse_session
from calib_core.stages.pipeline import run as run_stages
from tests.merge_sets import merge_session, scan_set

BEFORE_S = 21.0


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes scans of 36,000 points, else a quarter of it."""
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
