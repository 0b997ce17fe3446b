"""Distances between overlapping scans, what is expected of them, and the moves that close them."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calib_core.errors import InputError, MeasurementError
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.merge import VoxelGrid
from calib_core.fusion.mesh import Mesh, joined, poisson_mesh, sheet
from calib_core.fusion.overlap import PoseErrors, move_of_pose_change, overlap, patches
from calib_core.fusion.register import register
from calib_core.sphere.cloud import fit_sphere
from tests.merge_sets import fused

sphere_scans = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("sphere_scans.py"))))

NONE = np.zeros(6)
TCP = np.array([1e-4, 1e-4, 1e-4, 0.02, 0.02, 0.02])
ROBOT = np.array([2e-4, 2e-4, 2e-4, 0.05, 0.05, 0.05])
RADIUS, CENTER, SIGMA = sphere_scans.RADIUS_MM, sphere_scans.CENTER_MM, sphere_scans.POINT_SIGMA_MM


def cleaned(scans):
    return [clean_scan(scan) for scan in scans]


@pytest.mark.thorough
def test_overlap_rms_is_what_the_chains_covariance_predicts():
    squares, expected = 0.0, 0.0
    for seed in range(12):
        scans, errors = sphere_scans.scanned(18, 0.5, seed, TCP, ROBOT)
        seen = overlap(patches(cleaned(scans), 1.5), errors)
        squares += seen.rms_mm**2
        expected += seen.expected_rms_mm**2
    assert np.sqrt(squares / expected) == pytest.approx(1.0, abs=0.1)


def test_overlap_of_scans_in_their_right_places_is_the_noise():
    scans, _ = sphere_scans.scanned(18, 0.4, 0, NONE, NONE)
    seen = overlap(patches(cleaned(scans), 1.2))
    assert seen.pairs > 3000
    assert seen.rms_mm == pytest.approx(seen.expected_rms_mm, rel=0.1)
    assert seen.rms_mm < SIGMA


def test_a_scan_out_of_its_place_stands_out():
    scans, _ = sphere_scans.scanned(18, 0.5, 1, NONE, NONE)
    wrong = scans[4].turntable_from_laser.copy()
    wrong[0, :3, 3] += 0.2 * wrong[0, :3, 2]  # 0.2 mm deeper
    scans[4] = type(scans[4])("s04", scans[4].points_in_laser_mm, wrong, SIGMA)
    seen = overlap(patches(cleaned(scans), 1.5))
    assert np.argmax(seen.per_scan[:, 2]) == 4
    assert -0.2 < seen.per_scan[4, 1] < -0.1  # behind the others, by 0.2 mm times the cosine to its axis


def test_merged_sphere_of_72_scans():
    scans, errors = sphere_scans.scanned(72, 0.5, 2, 0.3 * TCP, 0.3 * ROBOT)
    fit = fit_sphere(fused(cleaned(scans), 0.5).points_mm.astype(float))
    assert abs(2 * fit.radius_mm - 2 * RADIUS) <= 0.02
    # Every scan's place is off by its own error and the shared one: what is left of them in the mean of all
    own = np.sqrt(np.mean(errors.own[:, 3:, 3:].diagonal(axis1=1, axis2=2))) / np.sqrt(72)
    shared = np.sqrt((errors.common.mean(axis=0)[3:] ** 2).sum(axis=1).max())
    assert np.linalg.norm(fit.center_mm - CENTER) < 3 * np.hypot(np.sqrt(3) * own + 0.004, 2 * shared)


def test_registration_closes_the_gaps_and_reports_its_moves():
    scans, errors = sphere_scans.scanned(18, 0.5, 3, NONE, ROBOT)
    seen = patches(cleaned(scans), 1.5)
    answer = register(seen, errors)
    quiet, _ = sphere_scans.scanned(18, 0.5, 3, NONE, NONE)
    assert answer.after.rms_mm < 1.1 * overlap(patches(cleaned(quiet), 1.5)).rms_mm
    assert answer.before.rms_mm > 3 * answer.after.rms_mm
    assert 0.02 < np.sqrt(np.mean(answer.shift_mm**2)) < 0.2
    # After it the errors are six for each scan: what is expected by the covariance is what it is one by one.
    common = np.random.default_rng(3).normal(0, 0.01, (18, 6, 5))
    few, many = (PoseErrors(np.pad(common, ((0, 0), (0, 0), (0, more))), errors.own) for more in (0, 100))
    assert overlap(seen, many).expected_rms_mm == pytest.approx(overlap(seen, few).expected_rms_mm, rel=1e-9)


def test_registration_leaves_scans_where_they_are_right():
    scans, _ = sphere_scans.scanned(18, 0.5, 4, NONE, NONE)
    answer = register(patches(cleaned(scans), 1.5))
    # A cap slides about the sphere's centre almost freely, within the turn that is allowed: 1 mrad over 20 mm.
    assert answer.shift_mm.max() < 0.05
    assert answer.turn_rad.max() < 0.004
    assert answer.after.rms_mm <= answer.before.rms_mm


def test_a_change_of_pose_moves_points_as_stated():
    rng = np.random.default_rng(5)
    pose = RigidTransform.of(rng.normal(size=3), 100 * rng.normal(size=3), "turntable", "laser")
    change, point = 1e-6 * rng.normal(size=6), 100 * rng.normal(size=3)
    move = move_of_pose_change(pose.matrix, change[:, None])[:, 0]
    moved = pose.apply(point) + np.cross(move[:3], pose.apply(point)) + move[3:]
    np.testing.assert_allclose(moved, pose.perturbed(change).apply(point), atol=1e-8)


def test_patches_turn_about_the_centre():
    scans, _ = sphere_scans.scanned(3, 1.0, 6, NONE, NONE)
    seen = patches(cleaned(scans), 3.0)
    move = np.array([0.1, 0.2, -0.3, 1, 2, 3])
    moved = seen.moved(np.tile(move, (3, 1)), CENTER)
    rotation = rotation_from_vector(move[:3])
    np.testing.assert_allclose(moved.points_mm, (seen.points_mm - CENTER) @ rotation.T + CENTER + move[3:])


def test_scans_that_do_not_overlap_have_no_distance():
    scans, _ = sphere_scans.scanned(1, 1.0, 7, NONE, NONE)
    seen = overlap(patches(cleaned(scans), 3.0))
    assert seen.pairs == 0
    assert np.isnan(seen.rms_mm)


def test_no_scans_and_errors_of_other_scans_are_refused():
    with pytest.raises(InputError, match="scans to compare"):
        patches([])
    scans, _ = sphere_scans.scanned(2, 1.0, 8, NONE, NONE)
    with pytest.raises(InputError, match="errors of 2 scans"):
        overlap(patches(cleaned(scans)), PoseErrors.none(3))


def area_mm2(mesh: Mesh) -> float:
    a, b, c = (mesh.points_mm[mesh.triangles[:, k]].astype(float) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_grid_mesh_lies_on_the_sphere_and_faces_outward():
    scans, _ = sphere_scans.scanned(3, 0.5, 9, NONE, NONE)
    sheets = [sheet(scan) for scan in cleaned(scans)]
    mesh = sheets[0]
    corners = mesh.points_mm[mesh.triangles].astype(float) - CENTER
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ni,ni->n", normals, corners.mean(axis=1)) > 0).all()
    # seen up to 78° from its pole, less a border
    seen = 2 * np.pi * RADIUS**2 * (1 - np.cos(np.deg2rad(78)))
    assert 0.8 * seen < area_mm2(mesh) < 1.1 * seen
    assert len(joined(sheets).triangles) > 2.5 * len(mesh.triangles)


def test_a_poisson_mesh_lies_on_the_sphere():
    scans, _ = sphere_scans.scanned(18, 0.7, 10, NONE, NONE)
    mesh = poisson_mesh(fused(cleaned(scans), 1.0), 1.0)
    distance = np.linalg.norm(mesh.points_mm - CENTER, axis=1) - RADIUS
    assert np.sqrt(np.mean(distance**2)) < 0.05
    assert area_mm2(mesh) > 0.75 * 4 * np.pi * RADIUS**2


def test_meshes_of_nothing_are_refused():
    scans, _ = sphere_scans.scanned(1, 1.0, 11, NONE, NONE)
    grid = VoxelGrid(1.0)
    grid.add(scans[0].points_in_laser_mm)
    with pytest.raises(MeasurementError, match="points with normals"):
        poisson_mesh(grid.cloud(), 1.0)
