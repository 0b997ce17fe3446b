"""Meshes of simulated parts: how sharp edges stay, what is watertight, what thinning takes, which way is out.

Parts are scanned with errors of poses as an arm makes them; the truth is the part.
"""

from collections.abc import Iterable
from itertools import product

import numpy as np
from harness import Row

from calib_core.formats.meshes import parse_mesh
from calib_core.fusion.mesh import Mesh
from calib_core.fusion.mesh_finish import open_edges, thinned
from calib_core.fusion.solve import MergeOptions, solve_merge
from calib_core.lean_open3d import open3d
from calib_core.records import parse_session
from calib_core.simulation.part import PartMesh
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run as run_stages
from tests.merge_sets import merge_session, scan_set
from tests.point_files import mesh_file

BOX_MM = np.array([60.0, 40.0, 30.0])
SHAPES = {
    "bracket": "around",
    "blade": "around",
    "sheet": "around",
    "ball": "around",
    "box": "around",
    "bowl": "above",
}


def distances_mm(mesh: Mesh, places: np.ndarray) -> np.ndarray:
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.points_mm), o3d.core.Tensor(mesh.triangles.astype(np.uint32)))
    return scene.compute_distance(o3d.core.Tensor(places.astype(np.float32))).numpy()


def edges_of_box() -> np.ndarray:
    """Places (N, 3) along the twelve edges, away from their corners."""
    half, along = BOX_MM / 2, np.linspace(-0.8, 0.8, 60)
    signs = np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])
    lines = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for pair in signs:
            line = np.zeros((len(along), 3))
            line[:, axis], line[:, others] = along * half[axis], pair * half[others]
            lines.append(line)
    return np.concatenate(lines)


def of_edges(full: bool) -> list[Row]:
    """An edge rounded by a radius r lies r (√2 − 1) below the sharp one."""
    radii, shares, apart = [], [], []
    for seed in range(3 if full else 1):
        there = scan_set("box", seed, pitch_mm=0.3, position_sigma_mm=0.02, orientation_sigma_rad=5e-5)
        mesh = solve_merge(there.scans, None, MergeOptions(0.5, "poisson", registration=True)).mesh
        assert mesh is not None
        radii.append(float(np.median(distances_mm(mesh, edges_of_box()) / (np.sqrt(2) - 1))))
        few = thinned(mesh, 0.05)
        shares.append(len(few.triangles) / len(mesh.triangles))
        apart.append(float(distances_mm(few, mesh.points_mm).max()))
    seeds = f"{len(radii)} seed{'s' if len(radii) > 1 else ''}"
    radius = float(np.mean(radii))
    return [
        Row(f"a 90° edge at 0.5 mm voxels, {seeds}: radius", "≤ 0.6 mm", f"{radius:.2f} mm", radius <= 0.6),
        Row(
            "that mesh thinned within 0.05 mm: triangles left; farthest",
            "≤ 0.05 mm",
            f"{100 * np.mean(shares):.0f} %; {max(apart):.3f} mm",
            max(apart) <= 0.05,
        ),
    ]


def faces_outward(mesh: Mesh, part: PartMesh) -> bool:
    """Return whether the mesh's triangles face as those of the part do where they lie."""
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(np.float32(part.points_mm)), o3d.core.Tensor(np.uint32(part.triangles)))
    corners = mesh.points_mm[mesh.triangles]
    nearest = scene.compute_closest_points(o3d.core.Tensor(corners.mean(axis=1)))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    near = np.linalg.norm(nearest["points"].numpy() - corners.mean(axis=1), axis=1) < 0.3
    return bool(((normals * nearest["primitive_normals"].numpy()).sum(axis=1)[near] > 0).mean() > 0.9)


def of_parts(full: bool) -> list[Row]:
    """Each seed has errors of its own, of which nothing is told; the part lies where it is known to."""
    outward, tight, ratios, seeds = 0, 0, list[float](), 20 if full else 3
    for seed, (shape, views) in product(range(seeds), SHAPES.items()):
        there = scan_set(shape, seed, views=views, pitch_mm=1.0)
        told = {"voxel_mm": 1.0, "mesh": "poisson", "holes": "fill", "reference": "part.stl", "alignment": "none"}
        record, files = merge_session(there, **told)
        files["part.stl"] = mesh_file("stl", there.part.points_mm, there.part.triangles)
        stored: dict[str, bytes] = {}

        def keep(name: str, pieces: Iterable[bytes | memoryview], stored: dict[str, bytes] = stored) -> None:
            stored[name] = b"".join(bytes(piece) for piece in pieces)

        result = run_stages(parse_session(record, "session"), files.__getitem__, "merge", store=keep)["merge"]
        assert isinstance(result, MergeResult)
        mesh = parse_mesh(stored["clouds/mesh.ply"], "mesh.ply")
        outward += faces_outward(Mesh(mesh.corners_mm.astype(np.float32), mesh.triangles), there.part)
        tight += open_edges(mesh.triangles) == 0
        assert result.deviation is not None
        assert result.deviation.uncertainty_mm is not None
        ratios.append(result.deviation.rms_mm / result.deviation.uncertainty_mm)
    count = len(ratios)
    ratio = float(np.sqrt(np.mean(np.square(ratios))))
    spread = f" (single parts {min(ratios):.2f}–{max(ratios):.2f})"
    what = f"six simulated parts × {seeds}, nothing told"
    return [
        Row(f"{what}: outward", "all", f"{outward} of {count}", outward == count),
        Row(f"{what}: deviation's RMS / stated", "0.8–1.2", f"{ratio:.2f}{spread}", 0.8 <= ratio <= 1.2),
        Row(f"{what}: watertight where asked", "all", f"{tight} of {count}", tight == count),
    ]


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full`: twenty seeds a part and three of edges, else three and one."""
    return [*of_edges(full), *of_parts(full)]
