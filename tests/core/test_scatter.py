"""How far poses scatter, found from the overlap alone: right within what a few scans can say."""

from functools import cache

import numpy as np
import pytest

from calib_core.errors import MeasurementError
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.overlap import Patches, overlap, patches
from calib_core.fusion.register import register
from calib_core.fusion.scatter import Scatter, scatter
from tests.merge_sets import scan_set, turn

DISTANCE_MM = 200.0


@cache
def seen(
    shape: str, seed: int, position_sigma_mm: float, orientation_sigma_rad: float
) -> tuple[Patches, tuple[int, ...]]:
    there = scan_set(
        shape, seed, position_sigma_mm=position_sigma_mm, orientation_sigma_rad=orientation_sigma_rad, alike=0.0
    )
    cleaned, numbers = [], []
    for number, scan in enumerate(there.scans):
        try:
            cleaned.append(clean_scan(scan))
            numbers.append(number)
        except MeasurementError:
            continue
    return patches(cleaned, 1.5), tuple(numbers)


def found_in(together: Patches) -> Scatter:
    found = scatter(together)
    assert found is not None
    return found


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("shape", "position", "turning"),
    [
        ("bracket", 0.01, 5e-5),
        ("bracket", 0.05, 2e-4),
        ("bracket", 0.2, 6e-4),
        ("blade", 0.05, 2e-4),
        ("sheet", 0.05, 2e-4),
    ],
)
def test_scatter_and_expected_overlap_are_right_with_nothing_told(shape: str, position: float, turning: float):
    together, _ = seen(shape, 5, position, turning)
    found = found_in(together)
    at_object = np.hypot(position, turning * DISTANCE_MM)
    assert 0.5 < found.position_sigma_mm / at_object < 1.7
    apart = overlap(found.with_noise(together), found.errors)
    assert 0.7 < apart.rms_mm / apart.expected_rms_mm < 1.4


def test_registration_brings_scans_nearer_to_the_truth_and_leaves_those_that_slide():
    together, numbers = seen("bracket", 5, 0.2, 6e-4)
    found = found_in(together)
    there = scan_set("bracket", 5, position_sigma_mm=0.2, orientation_sigma_rad=6e-4, alike=0.0)
    true = np.array([there.actual[k] @ np.linalg.inv(there.reported[k]) for k in numbers])
    moved = register(found.for_registration(together), found.errors)

    def off_mm(ways: np.ndarray) -> float:
        """RMS of the surface off the truth along its normal, but for what moves all scans alike."""
        flat = together.normals.any(axis=1)
        points, normals = together.points_mm[flat], together.normals[flat]
        apart = (ways - true)[together.scans[flat]]
        along = np.einsum("ni,nij,nj->n", normals, apart[:, :3], np.c_[points, np.ones(len(points))])
        alike = np.c_[np.cross(points, normals), normals]
        return float(np.sqrt(np.mean((along - alike @ np.linalg.lstsq(alike, along, rcond=None)[0]) ** 2)))

    unmoved = np.tile(np.eye(4), (len(numbers), 1, 1))
    assert off_mm(moved.turntable_from_scan) < 0.5 * off_mm(unmoved)  # what no other scan sees keeps its error
    assert moved.after.rms_mm < 0.1 * moved.before.rms_mm


def test_one_scan_far_off_does_not_excuse_all():
    together, _ = seen("bracket", 5, 0.05, 2e-4)
    moves = np.tile(np.eye(4), (len(together.names), 1, 1))
    moves[4, :3, :3], moves[4, :3, 3] = turn(np.array([0.0, 0.0, 0.003])), (0.4, -0.3, 0.35)
    shifted = together.transformed(moves)
    found = found_in(shifted)
    assert found.position_sigma_mm < 0.15
    apart = overlap(found.with_noise(shifted), found.errors)
    ratio = apart.per_scan[:, 2] / apart.per_scan[:, 3]
    assert int(np.nanargmax(ratio)) == 4


@pytest.mark.thorough
def test_scans_that_do_not_overlap_say_nothing():
    together, _ = seen("bracket", 5, 0.05, 2e-4)
    moves = np.tile(np.eye(4), (len(together.names), 1, 1))
    moves[:, 0, 3] = 500.0 * np.arange(len(moves))
    apart = patches([clean_scan(scan_set("bracket", 5).scans[0])], 1.5)
    assert scatter(apart) is None
