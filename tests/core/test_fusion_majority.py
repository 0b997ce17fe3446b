"""Which scan a merged point is said to come from."""

import numpy as np

from calib_core.fusion.majority import NO_SCAN, HeaviestScans
from calib_core.fusion.overlap import Patches


def two_scans() -> Patches:
    """Scan 0 sees x = 0…9, scan 1 x = 5…14, with less noise from 7 on; voxels of 1 mm in a row."""
    rows = [(x, scan) for x in range(15) for scan in (0, 1) if (x < 10 if scan == 0 else x >= 5)]
    x, scan = np.array(rows).T
    noise = np.where((scan == 1) == (x >= 7), 0.01, 0.02)
    bounds = np.concatenate([np.flatnonzero(np.diff(x, prepend=-1)), [len(x)]])
    points = np.stack([x + 0.5, 0.5 + 0 * x, 0.5 + 0 * x], axis=1).astype(float)
    return Patches(("a", "b"), scan, points, np.tile([0.0, 0, 1], (len(x), 1)), noise**2, bounds, 1.0)


def test_a_point_is_of_the_scan_that_weighs_most_in_its_patch() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform([0, 0, 0], [15, 1, 1], (500, 3)).astype(np.float32)
    np.testing.assert_array_equal(HeaviestScans(two_scans()).of(points), points[:, 0] >= 7)


def test_where_no_scan_has_a_patch_the_nearest_one_beside_it_counts() -> None:
    beside = np.array([[-0.1, 0.5, 0.5], [3.0, 0.5, 1.5], [15.1, 0.5, 0.5], [7.1, 1.2, 0.5]], dtype=np.float32)
    np.testing.assert_array_equal(HeaviestScans(two_scans()).of(beside), [0, 0, 1, 1])


def test_beside_all_patches_it_is_of_none() -> None:
    beside = np.array([[-1.1, 0.5, 0.5], [3.0, 0.5, 2.5], [16.1, 0.5, 0.5]], dtype=np.float32)
    np.testing.assert_array_equal(HeaviestScans(two_scans()).of(beside), NO_SCAN)
    assert len(HeaviestScans(two_scans()).of(beside[:0])) == 0
