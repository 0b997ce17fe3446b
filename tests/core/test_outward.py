"""Which way is out, found from the scans alone: solids, sheets, open surfaces; depths that count either way."""

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from calib_core.errors import MeasurementError
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.crew import MergeOptions
from calib_core.fusion.outward import View, outward, view_of
from calib_core.fusion.overlap import Patches, patches
from calib_core.fusion.scan import Scan
from calib_core.fusion.solve import solve_merge
from calib_core.simulation.surfaces import MeshSurface
from tests.merge_sets import scan_set

SETS = [
    ("box", "table"),
    ("bracket", "around"),
    ("blade", "around"),
    ("sheet", "around"),
    ("bowl", "table"),
    ("ball", "around"),
]


@cache
def seen(shape: str, views: str, toward: bool) -> tuple[Patches, tuple[View, ...]]:
    cleaned, looked = [], []
    for scan in scan_set(shape, 3, views=views, toward=toward, offset_mm=200.0 * toward).scans:
        try:
            cleaned.append(clean_scan(scan))
        except MeasurementError:
            continue  # nothing of the part was seen from there
        looked.append(view_of(scan))
    return patches(cleaned, 1.5), tuple(looked)


@pytest.mark.thorough(keep=4)
@pytest.mark.parametrize("toward", [False, True])
@pytest.mark.parametrize(("shape", "views"), SETS)
def test_who_sees_whom_tells_the_outside(shape: str, views: str, toward: bool):
    together, looked = seen(shape, views, toward)
    without_rays = [view._replace(spreading=float("nan"), spreading_sigma=float("nan")) for view in looked]
    found = outward(together, without_rays, 0.3)
    assert (found.sign, found.how, found.certain) == (-1 if toward else 1, "visibility", True)
    assert min(found.before, found.behind) < 0.05 * max(found.before, found.behind)


def test_a_bowl_scanned_from_above_has_a_negative_volume_and_is_right():
    together, looked = seen("bowl", "table", False)
    found = outward(together, looked, 0.3)
    assert found.volume < -0.1
    assert (found.sign, found.how) == (1, "visibility")


@pytest.mark.parametrize("toward", [False, True])
def test_one_scan_tells_it_by_its_rays(toward: bool):
    scan = scan_set("bracket", 3, views="around", toward=toward, offset_mm=200.0 * toward).scans[0]
    found = outward(patches([clean_scan(scan)], 1.5), [view_of(scan)], 0.3)
    assert (found.sign, found.how, found.certain) == (-1 if toward else 1, "rays", True)


def test_what_is_told_is_taken_and_its_contradiction_too():
    scans = [
        replace(scan, looks_along_z=1)
        for scan in scan_set("box", 3, views="table", toward=True, offset_mm=200.0).scans
    ]
    found = outward(patches([clean_scan(scan) for scan in scans], 1.5), [view_of(scan) for scan in scans], 0.3)
    assert (found.sign, found.how, found.certain, found.contradicts) == (1, "told", False, True)


def test_one_flat_scan_without_rays_leaves_a_doubt():
    x, y = np.meshgrid(np.arange(-20, 20, 0.5), np.arange(-20, 20, 0.5))
    z = np.random.default_rng(1).normal(0, 0.01, x.shape)
    scan = Scan("flat", np.stack([x, y, z], axis=-1).astype(np.float32), np.eye(4)[None])
    found = outward(patches([clean_scan(scan)], 1.5), [view_of(scan)], 0.3)
    assert (found.how, found.certain) == ("assumed", False)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("mesh", "limit"), [("poisson", 0.98), ("grid", 0.98)])
def test_cloud_and_mesh_face_outward_though_depths_count_toward_the_scanner(
    mesh: Literal["poisson", "grid"], limit: float
):
    there = scan_set("bracket", 3, views="around", toward=True, offset_mm=200.0)
    solution = solve_merge(there.scans, None, MergeOptions(voxel_mm=1.0, mesh=mesh))
    assert (solution.looked.outward.sign, solution.looked.outward.how) == (-1, "visibility")
    assert solution.mesh is not None
    corners = solution.mesh.points_mm[solution.mesh.triangles].astype(float)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    start = corners.mean(axis=1) + 3 * faces  # outside of the part nothing is met on the way back but the surface
    distance, normals = MeshSurface(there.part).cast(start, -faces)
    met = np.isfinite(distance) & (distance < 5)
    assert met.mean() > 0.9
    assert ((normals * faces).sum(axis=1)[met] > 0).mean() > limit
    cloud = solution.grid.cloud()
    known = np.isfinite(cloud.normals).all(axis=1)
    points, outside = cloud.points_mm[known].astype(float), cloud.normals[known].astype(float)
    distance, normals = MeshSurface(there.part).cast(points + 3 * outside, -outside)
    met = np.isfinite(distance) & (distance < 5)
    assert ((normals * outside).sum(axis=1)[met] > 0).mean() > limit
