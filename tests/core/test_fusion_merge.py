"""Voxel fusion against a plain computation with numpy: same voxels, same means, in memory and out of it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.archive.spill import FileSpill
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.fusion.merge import VoxelCloud, VoxelGrid
from calib_core.fusion.scan import Scan, as_rows
from calib_core.kernels.fusion import pack_keys, unpack_keys


def plain(points: np.ndarray, weights: np.ndarray, size: float) -> dict[tuple[int, int, int], np.ndarray]:
    """Voxel → weighted mean, weight and count, by sorting."""
    voxels, group = np.unique(np.floor(points / size).astype(int), axis=0, return_inverse=True)
    sums = np.zeros((len(voxels), 5))
    np.add.at(sums, group.ravel(), np.column_stack([points * weights[:, None], weights, np.ones(len(points))]))
    return {tuple(v): np.array([*s[:3] / s[3], s[3], s[4]]) for v, s in zip(voxels.tolist(), sums, strict=True)}


def by_voxel(cloud: VoxelCloud) -> dict[tuple[int, int, int], np.ndarray]:
    rows = np.column_stack([cloud.points_mm, 1 / cloud.sigma_mm.astype(float) ** 2, cloud.counts])
    return {tuple(v): r for v, r in zip(unpack_keys(cloud.keys).tolist(), rows, strict=True)}


def require_same(got: dict, expected: dict) -> None:
    assert got.keys() == expected.keys()
    for voxel, row in expected.items():
        np.testing.assert_allclose(got[voxel], row, rtol=2e-5, atol=2e-5)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.floats(0.2, 30), rows=st.integers(1, 5), columns=st.integers(1, 700))
def test_same_voxels_and_weighted_means_as_a_plain_computation(seed: int, size: float, rows: int, columns: int):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-50, 50, (rows, columns, 3)).astype(np.float32)
    weights = rng.uniform(0.1, 2500, (rows, columns)).astype(np.float32)
    poses = np.array(
        [RigidTransform.of(v, v * 9, "turntable", "laser").matrix for v in rng.normal(size=(rows, 3))]
    )
    grid = VoxelGrid(size)
    grid.add(points, poses, weights)
    moved = np.einsum("pij,pcj->pci", poses[:, :3, :3], points.astype(float)) + poses[:, None, :3, 3]
    expected = plain(moved.reshape(-1, 3), weights.ravel().astype(float), size)
    require_same(by_voxel(grid.cloud()), expected)
    assert grid.points_added == rows * columns


def test_blank_points_and_points_without_weight_are_left_out():
    points = np.full((2, 3, 3), np.nan, np.float32)
    points[0, 0] = points[1, 1] = points[1, 2] = (1, 2, 3)
    weights = np.ones((2, 3), np.float32)
    weights[1, 2] = 0
    grid = VoxelGrid(0.5)
    grid.add(points, None, weights)
    cloud = grid.cloud()
    assert (len(cloud), cloud.counts[0], grid.points_added) == (1, 2, 2)


def test_the_mean_of_a_voxel_counts_exact_points_more():
    points = np.array([[[0.1, 0.1, 0.1], [0.4, 0.1, 0.1]]], np.float32)
    sigma = np.array([[0.01, 0.02]], np.float32)
    grid = VoxelGrid(0.5)
    grid.add(points, None, 1 / sigma**2)
    cloud = grid.cloud()
    assert cloud.points_mm[0] == pytest.approx([0.1 + 0.3 / 5, 0.1, 0.1], abs=1e-6)
    assert cloud.sigma_mm[0] == pytest.approx(0.02 / np.sqrt(5), rel=1e-5)


def test_normals_are_rotated_and_averaged():
    points = np.tile(np.array([1.2, 0.2, 0.2], np.float32), (1, 4, 1))
    normals = np.array([[[1, 0, 0.1], [1, 0, -0.1], [1, 0.1, 0], [1, -0.1, 0]]], np.float32)
    quarter = RigidTransform.of([0, 0, np.pi / 2], [0, 0, 0], "turntable", "laser").matrix
    grid = VoxelGrid(1.0, normals=True)
    grid.add(points, quarter[None], 1.0, normals)
    assert grid.cloud().normals[0] == pytest.approx([0, 1, 0], abs=1e-6)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("most_bytes", [40_000, 400_000])
def test_beyond_the_memory_allowed_the_answer_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most_bytes: int
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    rng = np.random.default_rng(1)
    points = rng.uniform(-200, 200, (60, 200, 3)).astype(np.float32)
    free, bounded = VoxelGrid(2.0), None
    with FileSpill() as store:
        bounded = VoxelGrid(2.0, store=store, most_bytes=most_bytes)
        for part in np.array_split(points, 6):
            free.add(part)
            bounded.add(part)
        assert bounded.spills > 0
        assert bounded.peak_bytes <= most_bytes
        pieces = list(bounded.clouds())
        assert len(pieces) > 1
        keys = np.concatenate([piece.keys for piece in pieces])
        assert len(np.unique(keys)) == len(keys)
        require_same(by_voxel(bounded.cloud()), by_voxel(free.cloud()))
    assert not list(tmp_path.iterdir())


def test_a_full_disk_while_spilling_is_named_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    points = np.random.default_rng(2).uniform(-200, 200, (60, 200, 3)).astype(np.float32)
    with FileSpill() as store:
        grid = VoxelGrid(2.0, store=store, most_bytes=40_000)
        with Path("/dev/full").open("r+b", buffering=0) as full, monkeypatch.context() as patched:
            patched.setattr(store, "_file", full)
            with pytest.raises(InputError, match="no space left on device"):
                grid.add(points)
    assert not list(tmp_path.iterdir())


def test_occupied_voxels_are_those_of_open3d():
    import open3d as o3d

    rng = np.random.default_rng(4)
    direction = rng.normal(size=(30_000, 3))
    points = (
        40 * direction / np.linalg.norm(direction, axis=1)[:, None] + rng.normal(0, 0.02, (30_000, 3))
    ).astype(np.float32)
    pose = RigidTransform.of([0.3, -0.2, 0.9], [10, 20, 30], "turntable", "laser").matrix
    theirs = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float))).transform(pose)
    origin = theirs.get_min_bound() - 0.25
    thinned = np.asarray(theirs.voxel_down_sample(0.5).points)
    grid = VoxelGrid(0.5, origin)
    grid.add(as_rows(points), pose[None])
    cloud = grid.cloud()
    voxels = np.floor((thinned - origin) / 0.5).astype(np.int64)
    order, same = np.argsort(cloud.keys), np.argsort(pack_keys(voxels))
    assert np.array_equal(cloud.keys[order], pack_keys(voxels)[same])
    np.testing.assert_allclose(cloud.points_mm[order], thinned[same], atol=2e-5)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(*[st.integers(-(2**20), 2**20 - 1)] * 3), min_size=1, max_size=20))
def test_keys_pack_and_unpack(indices: list[tuple[int, int, int]]):
    array = np.array(indices, dtype=np.int64)
    assert np.array_equal(unpack_keys(pack_keys(array)), array)
    assert (pack_keys(array) >= 0).all()


def test_points_beyond_the_grid_are_refused_by_name():
    grid = VoxelGrid(0.5)
    with pytest.raises(InputError, match=r"scan7.*farther away.*unit"):
        grid.add(np.full((1, 2, 3), 1e9, np.float32), where="scan7")


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan, np.inf])
def test_a_voxel_size_must_be_a_positive_number(size: float):
    with pytest.raises(InputError, match="positive voxel size"):
        VoxelGrid(size)


@pytest.mark.parametrize(
    ("poses", "weights"),
    [(np.tile(np.eye(4), (3, 1, 1)), 1.0), (np.eye(4)[None], np.ones((2, 5), np.float32))],
)
def test_arrays_of_another_size_are_refused(poses: np.ndarray, weights: np.ndarray):
    with pytest.raises(InputError, match="another size"):
        VoxelGrid(0.5).add(np.zeros((2, 4, 3), np.float32), poses, weights)


def test_weights_that_are_no_numbers_are_refused():
    with pytest.raises(InputError, match="finite weights"):
        VoxelGrid(0.5).add(np.zeros((1, 2, 3), np.float32), None, np.array([[1, np.nan]], np.float32))


IDENTITY = RigidTransform.identity("turntable", "laser")


def test_scans_without_points_are_refused():
    with pytest.raises(InputError, match="5 blanks"):
        Scan("s1", np.full((1, 5, 3), np.nan, np.float32), np.eye(4)[None])
    with pytest.raises(InputError, match="no points"):
        Scan("s1", np.empty((0, 4, 3), np.float32), np.eye(4)[None])


def test_poses_that_are_not_finite_and_noise_of_zero_are_refused():
    points = np.zeros((1, 1, 3), np.float32)
    with pytest.raises(InputError, match="finite poses"):
        Scan("s1", points, np.full((1, 4, 4), np.nan))
    with pytest.raises(InputError, match="positive point_sigma_mm"):
        Scan("s1", points, np.eye(4)[None], point_sigma_mm=0.0)
