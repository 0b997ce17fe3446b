"""Writing PLY beside Open3D, read back by Open3D and trimesh."""

import tempfile
from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh
from harness import Row, interleaved_medians_s

from calib_core.formats.ply import ply_pieces
from calib_core.formats.shared.writing import write_pieces


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the two million points of the target."""
    count = 2_000_000 if full else 200_000
    points = np.random.default_rng(0).uniform(-300, 300, (count, 3)).astype(np.float32)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float)))
    with tempfile.TemporaryDirectory() as folder:
        ours, theirs = Path(folder) / "ours.ply", Path(folder) / "theirs.ply"
        times = interleaved_medians_s(
            {
                "ours": lambda: write_pieces(ours, ply_pieces(points)),
                "theirs": lambda: o3d.io.write_point_cloud(str(theirs), cloud),
            },
            rounds=7,
        )
        by_open3d = np.asarray(o3d.io.read_point_cloud(str(ours)).points)
        by_trimesh = np.asarray(trimesh.load(ours).vertices)
    ratio = times["theirs"] / times["ours"]
    figures = f"{ratio:.1f} × ({1e3 * times['ours']:.1f} ms, Open3D {1e3 * times['theirs']:.1f} ms)"
    equal = np.array_equal(by_open3d, points) and np.array_equal(by_trimesh, points)
    return [
        Row(f"PLY, {count:,} points", "≥ 10 × faster than Open3D", figures, ratio >= 10),
        Row(
            f"PLY, {count:,} points, read back by Open3D and trimesh", "equal", "equal" if equal else "not", equal
        ),
    ]
