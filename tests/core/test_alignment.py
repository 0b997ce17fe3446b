"""The nominal part found among merged points: pose, covariance, strays, symmetry, datum points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, f

from calib_core.errors import MeasurementError
from calib_core.fusion.alignment import Alignment, _clustered, _turn_rad, best_fit
from calib_core.fusion.datums import Feature, by_datums, on_nominal
from calib_core.fusion.deviation import Nominal
from calib_core.simulation.part import build_part
from tests import shapes

NOISE_MM = 0.02


def pose_of(rng: np.random.Generator) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), 100 * rng.standard_normal(3)
    return pose


def points_of(nominal: Nominal, pose: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of four fifths of the part, with noise, and one in twenty from anywhere."""
    rng = np.random.default_rng(seed)
    points, normals = nominal.spread(12_000, seed)
    along = points @ Rotation.random(rng=rng).as_matrix()[0]
    there = along < np.quantile(along, 0.8)
    points, normals = points[there], normals[there]
    points = points + NOISE_MM * rng.standard_normal((len(points), 1)) * normals
    stray = rng.choice(len(points), len(points) // 20, replace=False)
    points[stray] = rng.uniform(points.min(axis=0) - 5, points.max(axis=0) + 5, (len(stray), 3))
    return points @ pose[:3, :3].T + pose[:3, 3], normals @ pose[:3, :3].T


def error_of(found: Alignment, pose: np.ndarray) -> np.ndarray:
    turned = Rotation.from_matrix(pose[:3, :3].T @ found.cloud_from_reference[:3, :3]).as_rotvec()
    return np.concatenate([turned, found.cloud_from_reference[:3, 3] - pose[:3, 3]])


@pytest.mark.thorough
def test_a_part_anywhere_is_found_within_what_is_stated() -> None:
    nominal = Nominal(build_part().points_mm, build_part().triangles)
    squares = []
    for seed in range(2):
        pose = pose_of(np.random.default_rng(seed))
        found = best_fit(*points_of(nominal, pose, seed), nominal)
        error = error_of(found, pose)
        squares.append(error @ np.linalg.solve(found.covariance, error))
        assert found.alike == 0
        assert found.rms_mm == pytest.approx(NOISE_MM, rel=0.2)
        assert found.share > 0.9
    assert sum(squares) < chi2.ppf(0.999, 6 * len(squares))


@pytest.mark.thorough
def test_of_a_symmetric_part_the_pose_nearest_to_it_counts_and_the_others_are_told() -> None:
    box = shapes.box()
    nominal = Nominal(box.points_mm, box.triangles)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), [80.0, 0.0, 10.0]
    points, normals = nominal.spread(8000)
    found = best_fit(points @ pose[:3, :3].T + pose[:3, 3], normals @ pose[:3, :3].T, nominal)
    assert found.alike >= 1
    assert np.abs(error_of(found, pose)).max() < 1e-3


def test_six_datum_points_hold_the_part_where_it_touches_and_five_do_not() -> None:
    part = build_part()
    nominal = Nominal(part.points_mm, part.triangles)
    points, normals = nominal.spread(60_000)
    start = Alignment(np.eye(4), 0.0, np.eye(6))
    datum = [[-40, -32, 5], [40, -32, 5], [0, -32, 15], [-48, 0, 3], [-48, 0, 15], [10, -20, 30]]
    lifted = points + 0.1 * normals  # the part is 0.1 mm too large all over
    touches = [on_nominal(nominal, "point", np.array(place, dtype=float), 3.0) for place in datum]
    found = by_datums(lifted, normals, nominal, touches, start)
    there = np.linalg.inv(found.cloud_from_reference)
    for place in ([0.0, -32.1, 5.0], [-48.1, 0.0, 9.0]):
        assert nominal.distances_mm([there[:3, :3] @ place + there[:3, 3]])[0] == pytest.approx(0, abs=2e-3)
    fourth = on_nominal(nominal, "point", np.array([10.0, -32.0, 5.0]), 3.0)
    with pytest.raises(MeasurementError, match=r"leave open: a shift along \(0, 0, 1\)"):
        by_datums(points, normals, nominal, [*touches[:5], fourth], start)
    with pytest.raises(MeasurementError, match="none at"):
        by_datums(points + 500.0, normals, nominal, touches, start)


def features_of(nominal: Nominal) -> list[Feature]:
    """The part's ball, told by a place on it, and two of its walls."""
    ball = on_nominal(nominal, "sphere", np.array([-16.0, -16.0, 62.0]), 10.0)
    walls = [on_nominal(nominal, "plane", np.array(place), 10.0) for place in ([0.0, -32, 14], [48.0, 0, 15])]
    return [ball, *walls]


@pytest.mark.thorough
def test_datum_planes_and_spheres_lay_the_part_within_what_is_stated() -> None:
    nominal = Nominal(build_part().points_mm, build_part().triangles)
    features = features_of(nominal)
    assert features[0].at_mm == pytest.approx([-16, -16, 52], abs=1e-3)
    points, normals = nominal.spread(40_000)
    squares = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        pose = pose_of(rng)
        noisy = points + NOISE_MM * rng.standard_normal((len(points), 1)) * normals
        stray = rng.choice(len(points), len(points) // 20, replace=False)
        noisy[stray] += rng.uniform(-2, 2, (len(stray), 3))
        near = pose.copy()
        near[:3, :3], near[:3, 3] = (
            pose[:3, :3] @ Rotation.from_rotvec([0.003, -0.002, 0.002]).as_matrix(),
            pose[:3, 3] + [0.1, 0.2, -0.1],
        )
        cloud = noisy @ pose[:3, :3].T + pose[:3, 3], normals @ pose[:3, :3].T
        found = by_datums(*cloud, nominal, features, Alignment(near, 0.05, np.eye(6)))
        error = error_of(found, pose)
        squares.append(error @ np.linalg.solve(found.covariance, error))
        assert [round(one.radius_mm, 1) for one in found.measured] == [10, 10, 10]
    assert chi2.ppf(0.001, 6 * len(squares)) < sum(squares) < chi2.ppf(0.999, 6 * len(squares))


def test_what_datums_leave_open_is_named_and_so_is_one_that_is_not_there() -> None:
    nominal = Nominal(build_part().points_mm, build_part().triangles)
    ball, front, side = features_of(nominal)
    points, normals = nominal.spread(40_000)
    start = Alignment(np.eye(4), 0.02, np.eye(6))
    for features, open_ways in (
        ([ball], r"a turn about \(1, 0, 0\), a turn about \(0, 1, 0\) and a turn about \(0, 0, 1\)"),
        ([front, side], r"open: a shift along \(0, 0, 1\)\."),
        ([ball, front], r"open: a turn about \(0, 1, 0\)\."),
    ):
        with pytest.raises(MeasurementError, match=open_ways):
            by_datums(points, normals, nominal, features, start)
    low = points[:, 2] < 40
    with pytest.raises(MeasurementError, match="points around each datum"):
        by_datums(points[low], normals[low], nominal, [ball, front, side], start)
    far = np.linalg.norm(points - front.at_mm, axis=1) > 11
    row = front.at_mm + np.linspace(-6, 6, 60)[:, None] * [1.0, 0, 0]
    lined = np.concatenate([points[far], row]), np.concatenate([normals[far], np.tile(front.normal, (60, 1))])
    with pytest.raises(MeasurementError, match="a single line of them"):
        by_datums(*lined, nominal, [ball, front, side], start)
    with pytest.raises(MeasurementError, match="radius 4 mm on the nominal"):
        on_nominal(nominal, "sphere", np.array([-48.0, 0, 10]), 4.0)


@pytest.mark.thorough
def test_another_part_is_not_taken_for_this_one() -> None:
    nominal = Nominal(shapes.ball().points_mm, shapes.ball().triangles)
    flat = np.random.default_rng(0).uniform(-100, 100, (2000, 3)) * [1, 1, 0]
    with pytest.raises(MeasurementError, match="reference"):
        best_fit(flat, np.tile([0.0, 0.0, 1.0], (2000, 1)), nominal)


def test_deviations_of_one_part_of_the_nominal_count_once_together() -> None:
    box = shapes.box()
    nominal = Nominal(box.points_mm, box.triangles)
    rng, size = np.random.default_rng(4), nominal.extent_mm / 8
    corners = np.stack(np.meshgrid(*[np.arange(-2, 2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = np.repeat(corners, 9, axis=0)  # 64 places with nine points each
    there = nominal.middle_mm + size * (cells + rng.uniform(0.1, 0.9, cells.shape))
    rows, distance = rng.standard_normal((len(there), 6)), rng.standard_normal(len(there))
    scores = (rows * distance[:, None]).reshape(64, 9, 6).sum(axis=1)
    within = scores.T @ scores
    wider = 6 * 63 / 58 * f.ppf(0.95, 6, 58) / chi2.ppf(0.95, 6)  # Hotelling's, of 64 that are alike
    found = _clustered(rows, distance, np.eye(6), there, nominal)
    np.testing.assert_allclose(found, wider * within, rtol=1e-3, atol=1e-6 * np.abs(within).max())


def test_how_far_a_pose_is_turned_is_its_rotations_angle() -> None:
    for angle in (0.0, 0.01, 1.0, 2.0, 3.1):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec(angle * np.array([0.6, 0.0, -0.8])).as_matrix()
        assert _turn_rad(pose) == pytest.approx(angle, abs=1e-6)
