"""The whole merge on scans of a sphere: one cloud, one mesh, the overlap, and what is of no use named."""

import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calib_core.errors import InputError, MeasurementError
from calib_core.fusion.scan import Scan
from calib_core.fusion.solve import MergeOptions, solve_merge
from calib_core.sphere.cloud import fit_sphere

sphere_scans = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("sphere_scans.py"))))
ROBOT = np.array([2e-4, 2e-4, 2e-4, 0.05, 0.05, 0.05])
NONE = np.zeros(6)


def radial_rms(points: np.ndarray) -> float:
    distance = np.linalg.norm(points - sphere_scans.CENTER_MM, axis=1) - sphere_scans.RADIUS_MM
    return float(np.sqrt(np.mean(distance**2)))


def nothing_but_strays() -> Scan:
    points = np.full((40, 40, 3), np.nan, np.float32)
    points[::4, ::4] = np.random.default_rng(0).uniform(-50, 50, (10, 10, 3))
    return Scan("spoiled", points, np.eye(4)[None])


def test_scans_become_one_cloud_and_one_mesh_and_progress_moves():
    scans, errors = sphere_scans.scanned(12, 0.6, 0, NONE, ROBOT)
    told: list[float] = []
    solution = solve_merge(
        scans, errors, MergeOptions(voxel_mm=1.0), lambda fraction, _what: told.append(fraction)
    )
    assert solution.used == tuple(scan.name for scan in scans)
    assert 0.4 < solution.overlap.rms_mm / solution.overlap.expected_rms_mm < 2.0
    assert radial_rms(solution.grid.cloud().points_mm) < 0.06
    assert solution.mesh is not None
    assert radial_rms(solution.mesh.points_mm) < 0.1
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)
    for counts in solution.counts.values():
        assert counts.points == counts.kept + sum(counts.removed.values())


def test_registration_is_an_option_and_makes_the_cloud_thinner():
    scans, errors = sphere_scans.scanned(12, 0.6, 1, NONE, ROBOT)
    as_calibrated, registered = (
        solve_merge(scans, errors, MergeOptions(voxel_mm=1.0, mesh="none", registration=asked))
        for asked in (False, True)
    )
    assert as_calibrated.registration is None
    assert registered.registration is not None
    assert registered.overlap.rms_mm == pytest.approx(as_calibrated.overlap.rms_mm)  # reported before registration
    assert registered.registration.after.rms_mm < 0.5 * registered.overlap.rms_mm
    assert registered.registration.shift_mm.max() > 0.02
    roughness = [fit_sphere(s.grid.cloud().points_mm.astype(float)).rms_mm for s in (as_calibrated, registered)]
    assert roughness[1] < roughness[0]


def test_a_mesh_of_the_scans_own_grids():
    scans, _ = sphere_scans.scanned(3, 0.6, 2, NONE, NONE)
    solution = solve_merge(scans, None, MergeOptions(voxel_mm=1.0, mesh="grid"))
    assert solution.mesh is not None
    assert radial_rms(solution.mesh.points_mm) < 0.03


def test_a_scan_of_no_use_is_named_and_the_others_are_merged():
    scans, errors = sphere_scans.scanned(4, 0.6, 3, NONE, NONE)
    mixed = [scans[0], nothing_but_strays(), *scans[1:3]]
    solution = solve_merge(mixed, errors, MergeOptions(voxel_mm=1.0, mesh="none"))
    assert solution.used == ("s00", "s01", "s02")
    assert list(solution.failed) == ["spoiled"]
    assert len(solution.overlap.per_scan) == 3


def test_scans_of_different_sizes_are_merged():
    scans, _ = sphere_scans.scanned(3, 0.6, 4, NONE, NONE)
    scans[1] = replace(scans[1], points_in_laser_mm=np.ascontiguousarray(scans[1].points_in_laser_mm[10:50, 5:]))
    assert solve_merge(scans, None, MergeOptions(voxel_mm=1.0, mesh="none")).used == ("s00", "s01", "s02")


def test_nothing_to_merge_is_refused():
    with pytest.raises(InputError, match="at least one scan, got none"):
        solve_merge([])
    with pytest.raises(MeasurementError, match="spoiled: need points on a surface"):
        solve_merge([nothing_but_strays()])


def test_a_merge_can_be_stopped():
    scans, _ = sphere_scans.scanned(3, 1.0, 5, NONE, NONE)

    def stop(fraction: float, _what: str) -> None:
        if fraction > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_merge(scans, None, MergeOptions(voxel_mm=1.0), stop)
