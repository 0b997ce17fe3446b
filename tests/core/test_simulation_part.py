"""The simulated part and its scans: truth is the mesh, and what the scanner adds to it is as stated."""

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calib_core.formats.points import parse_cloud
from calib_core.formats.shared.writing import write_pieces
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.clean_scan import KEPT
from calib_core.fusion.merge import VoxelGrid
from calib_core.fusion.scan import Scan
from calib_core.robots import parse_pose
from calib_core.simulation import simulate
from calib_core.simulation.part import BALL_RADIUS_MM, HEIGHT_MM, HOLES, build_part, top_mm
from calib_core.simulation.part_scan import PartScan, PartScanner, PartScanOptions, view_poses
from calib_core.sphere.cloud import fit_sphere
from calib_core.stages.merge.solve import CLOUD_FILE, MESH_FILE
from calib_core.stages.pipeline import run

PART = build_part()
MESH = trimesh.Trimesh(PART.points_mm, PART.triangles, process=False)
OPTIONS = PartScanOptions(pitch_mm=0.5, stray_fraction=0.01)


def in_turntable(scan: PartScan) -> np.ndarray:
    """Return the measured points in T, (P, C, 3), at the poses where they were really taken."""
    poses = scan.turntable_from_laser
    return np.einsum("pij,pcj->pci", poses[:, :3, :3], scan.points_in_laser_mm) + poses[:, None, :3, 3]


@pytest.fixture(scope="module")
def scans():
    scanner = PartScanner(PART, OPTIONS)
    rng = np.random.default_rng(0)
    return [scanner.scan(pose, rng) for pose in view_poses(12)]


def distances(points: np.ndarray) -> np.ndarray:
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(PART.points_mm.astype(np.float32)), o3d.core.Tensor(PART.triangles.astype(np.uint32))
    )
    return scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()


def test_the_block_is_closed_but_for_its_underside_and_faces_outward():
    _, label = connected_components(coo_array((np.ones(len(MESH.edges)), MESH.edges.T), (len(MESH.vertices),) * 2))
    corner = np.argmin(MESH.vertices[:, 0])
    block = trimesh.Trimesh(MESH.vertices, MESH.faces[label[MESH.faces[:, 0]] == label[corner]], process=False)
    edges, counts = np.unique(np.sort(block.edges, axis=1), axis=0, return_counts=True)
    open_edges = edges[counts == 1]
    assert counts.max() == 2
    ends = block.vertices[open_edges]
    under = (ends[..., 2] == 0).all(axis=1)
    # where the step meets the long sides, its upright edge is one on one side and two on the other
    beside_step = ((ends[..., 0] == 24) & (np.abs(ends[..., 1]) == 32)).all(axis=1)
    assert (under | beside_step).all()
    x, y = np.meshgrid(np.linspace(-47.5, 47.5, 400), np.linspace(-31.5, 31.5, 400))
    volume = float((top_mm(x, y) + 6.0 * (x > 24)).mean()) * 96 * 64
    volume -= sum(np.pi * radius**2 * HEIGHT_MM for _, _, radius in HOLES)
    # z·n_z summed over the open surface is its volume above z = 0
    areas, centers = block.area_faces, block.triangles_center
    assert float((areas * block.face_normals[:, 2] * centers[:, 2]).sum()) == pytest.approx(volume, rel=0.01)


def test_the_ball_is_round():
    ball = PART.points_mm[PART.points_mm[:, 2] > 45]
    radii = np.linalg.norm(ball - PART.ball_center_mm, axis=1)
    assert np.abs(radii[ball[:, 2] > 47] - BALL_RADIUS_MM).max() < 1e-6


@pytest.mark.thorough
def test_true_points_lie_on_the_mesh_and_measured_ones_off_it_by_the_noise(scans):
    for scan in scans[:3]:
        good = np.isfinite(scan.points_in_laser_mm[..., 2]) & ~scan.strays & ~scan.mixed
        assert distances(scan.true_points_mm[good]).max() < 1e-3
        error = distances(in_turntable(scan)[good])
        # the distance to the surface has the noise stated; at edges the nearest surface may be another
        assert np.sqrt(np.mean(error[error < 0.1] ** 2)) == pytest.approx(OPTIONS.point_sigma_mm, rel=0.1)
        assert np.abs(scan.points_in_laser_mm[..., 1][good]).max() == 0


def test_what_the_camera_cannot_see_is_missing(scans):
    high, low = (int(np.isfinite(scan.points_in_laser_mm[..., 2]).sum()) for scan in (scans[2], scans[0]))
    assert high > 3000
    with_camera = PartScanner(PART, OPTIONS)
    beside = PartScanner(PART, PartScanOptions(pitch_mm=0.5, stray_fraction=0.01, baseline_mm=0.001))
    pose = view_poses(12)[0]
    occluded, all_seen = (
        int(np.isfinite(s.scan(pose, np.random.default_rng(1)).points_in_laser_mm[..., 2]).sum())
        for s in (with_camera, beside)
    )
    assert occluded < 0.97 * all_seen
    assert low > 1000


def test_the_same_seed_gives_the_same_scan():
    scanner = PartScanner(PART, PartScanOptions(pitch_mm=3.0))
    one, two = (scanner.scan(view_poses(3)[1], np.random.default_rng(5)).points_in_laser_mm for _ in range(2))
    np.testing.assert_array_equal(one, two)


@pytest.mark.thorough
def test_the_merged_part_lies_on_the_truth(scans):
    """Cleaning takes strays and mixed points away; what is left is the part, its ball of the right size."""
    grid = VoxelGrid(1.0, normals=True)
    dropped = wrong = lost = good = 0
    for number, scan in enumerate(scans):
        points = scan.points_in_laser_mm.astype(np.float32)
        clean = clean_scan(Scan(f"v{number}", points, scan.turntable_from_laser, OPTIONS.point_sigma_mm))
        weights = (clean.verdicts == KEPT) / clean.sigma_mm**2
        grid.add(clean.points_in_turntable_mm, None, weights, clean.normals)
        there = np.isfinite(points[..., 2])
        off = there & (scan.strays | scan.mixed)
        off[there] &= distances(in_turntable(scan)[there]) > 0.5
        kept = clean.verdicts == KEPT
        dropped, wrong = dropped + int((off & ~kept).sum()), wrong + int(off.sum())
        surface = there & ~(scan.strays | scan.mixed)
        lost, good = lost + int((surface & ~kept).sum()), good + int(surface.sum())
    assert dropped > 0.97 * wrong
    assert lost < 0.15 * good  # points beside edges, where half the neighbours are missing
    cloud = grid.cloud()
    assert np.quantile(distances(cloud.points_mm), 0.99) < 0.25
    ball = cloud.points_mm[np.abs(np.linalg.norm(cloud.points_mm - PART.ball_center_mm, axis=1) - 10) < 0.5]
    fit = fit_sphere(ball[ball[:, 2] > 48].astype(float))
    assert abs(2 * fit.radius_mm - 2 * BALL_RADIUS_MM) < 0.05


@pytest.mark.thorough
def test_a_scanned_part_merges_to_its_truth_through_a_session(tmp_path):
    result, truth, points, mesh = merged_part(tmp_path)
    assert result.verdict == "pass"
    assert 0.7 < result.overlap_rms_mm / result.expected_overlap_rms_mm < 1.4
    assert np.quantile(distances(points), 0.95) < 0.15
    near = np.abs(np.linalg.norm(points - truth["ball_center_in_turntable_mm"], axis=1) - 10) < 0.4
    fit = fit_sphere(points[near & (points[:, 2] > 46)])
    assert abs(2 * fit.radius_mm - truth["ball_diameter_mm"]) < 0.05
    assert np.linalg.norm(fit.center_mm - truth["ball_center_in_turntable_mm"]) < 0.1
    assert np.quantile(distances(mesh.vertices), 0.9) < 0.2


def merged_part(folder):
    """The result of the scenario's merge, its truth, and the files that it stored."""
    simulated = simulate("part", 1)
    files = simulated.files
    results = run(
        simulated.session,
        files.__getitem__,
        store=lambda name, pieces: write_pieces(folder / name, pieces),
    )
    assert list(results) == ["merge"]
    points = parse_cloud((folder / CLOUD_FILE).read_bytes(), CLOUD_FILE)
    return results["merge"], simulated.truth, points, trimesh.load_mesh(folder / MESH_FILE)


@pytest.mark.thorough
def test_the_whole_cell_scans_the_part_from_the_robots_side_of_its_own_table() -> None:
    """Every scan, placed by the truth, lies on the part; the arm stays where it is and the table turns."""
    simulated = simulate("cell", 5)
    steps = [capture.step for capture in simulated.session.captures]
    assert (steps.count("tcp"), steps.count("turntable"), steps.count("scan")) == (14, 16, 12)
    scans = [capture for capture in simulated.session.captures if capture.step == "scan"]
    assert np.ptp([capture.pose[:3] for capture in scans if capture.pose], axis=0).max() < 400
    assert len({capture.table_deg for capture in scans}) == 12
    tool, table = (np.array(simulated.truth[name]) for name in ("tool0_from_laser", "base_from_turntable"))
    low, high = PART.points_mm.min(axis=0), PART.points_mm.max(axis=0)
    for capture in scans[:3]:
        points = parse_cloud(simulated.files[capture.files[0]], capture.files[0])
        assert capture.pose is not None
        assert capture.table_deg is not None
        angle = np.deg2rad(capture.table_deg)
        turned = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        base_from_laser = parse_pose("abb", capture.pose).matrix @ tool
        in_base = points @ base_from_laser[:3, :3].T + base_from_laser[:3, 3]
        in_table = (in_base - table[:3, 3]) @ table[:3, :3] @ turned.T
        inside = ((in_table > low - 0.5) & (in_table < high + 0.5)).all(axis=1)
        assert inside.mean() > 0.97, capture.id  # strays are the rest
