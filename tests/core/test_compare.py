"""Two results side by side, and what a frame's uncertainty means at the workpiece."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib_core.archive.folder import result_data
from calib_core.errors import InputError
from calib_core.exports.workpiece import at_workpiece, point_jacobian, turned_deg
from calib_core.frames import RigidTransform
from calib_core.records import Session, parse_session
from calib_core.review.compare import Compared, changes, compare_results, frame_difference
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage


@pytest.fixture(scope="module")
def solved() -> tuple[Session, dict[str, Any]]:
    made = simulate("tcp", 3)
    return made.session, result_data(solve_stage(made.session, "tcp", made.files.__getitem__))


@given(
    turn=st.lists(st.floats(-2, 2), min_size=3, max_size=3),
    point=st.lists(st.floats(-300, 300), min_size=3, max_size=3),
    change=st.lists(st.floats(-1e-4, 1e-4), min_size=6, max_size=6),
)
def test_a_points_derivative_by_its_frame(turn: list[float], point: list[float], change: list[float]) -> None:
    frame = RigidTransform.of(turn, [10.0, -20.0, 30.0], "tool0", "laser")
    p = np.array(point)
    moved = frame.perturbed(change).apply(p) - frame.apply(p)
    # What is left is of second order: angle² · distance.
    assert np.allclose(point_jacobian(frame, p) @ change, moved, atol=1e-5)


def test_the_workpieces_sigma_is_what_poses_drawn_from_the_covariance_scatter() -> None:
    made = simulate("tcp", 15)
    session, result = made.session, result_data(solve_stage(made.session, "tcp", made.files.__getitem__))
    (known,) = at_workpiece(session, result)
    assert known.of == "tool"
    names, found, arm = result["scanner"]["names"], result["scanner"], result["arm_errors"]
    frame = RigidTransform.from_rounded(result["tool0_from_laser"], "tool0", "laser")
    cross, lengths = np.array(found["covariance_with_tool"]), np.array(arm["tool_with_lengths"])[:, None]
    of_scanner = np.array(arm["scanner_with_lengths"])[:, None]
    joint = np.block(
        [
            [np.array(result["covariance"])[:6, :6], cross, lengths],
            [cross.T, np.array(found["covariance"]), of_scanner],
            [lengths.T, of_scanner.T, np.array([[arm["lengths_sigma"] ** 2]])],
        ]
    )
    drawn = np.random.default_rng(5).multivariate_normal(np.zeros(7 + len(names)), joint, 4000)
    point = np.array(known.point_mm)
    # In base as the arm tells it: an arm that is too long tells the flange too far from the point by as much.
    moved = [
        frame.perturbed(xi[:6]).apply(_seen(point, names, xi[6:-1])) - xi[-1] * frame.apply(point) for xi in drawn
    ]
    moved = np.array(moved) @ frame.rotation
    # A standard deviation of 4000 draws is itself known to 1.1 %. Lengths that were found and the step to the tool
    # of the poses as told are one cause, which the record does not tell apart: 2 % here, at most 11 % of 15.
    assert np.allclose(moved.std(axis=0), known.sigmas_mm, rtol=0.05)
    assert max(known.sigmas_mm) <= known.worst_sigma_mm <= float(np.linalg.norm(known.sigmas_mm))
    # The sphere stands 150 to 230 mm before this scanner, within 20 mm along its stripe.
    assert 150 < abs(known.point_mm[2]) < 230
    assert abs(known.point_mm[0]) < 20


def _seen(point: np.ndarray, names: list[str], errors: np.ndarray) -> np.ndarray:
    """Return where a scanner with errors sees a point (x, 0, z) that the light meets straight on."""
    by = dict(zip(names, errors, strict=True))
    x, _, z = point
    along = z * by["scale_z"] - sum(c * by[f"incidence_{n}_mm"] for n, c in ((1, 0.3), (2, 0.15), (4, 0.05)))
    along += by["bow"] * x**2 / 40.0  # the half width, nearly; the point lies in the middle
    return np.array([x * (1 + by["scale_x"]) + z * by["shear"], 0.0, z + along])


@pytest.mark.thorough
def test_table_and_tool_together_are_known_better_than_their_errors_added() -> None:
    made = simulate("turntable", 2)
    result = result_data(solve_stage(made.session, "chain", made.files.__getitem__))
    rows = at_workpiece(made.session, result)
    assert [row.of for row in rows] == ["tool", "table", "table", "both", "both"]
    tool = rows[0].worst_sigma_mm
    for table, both in zip(rows[1:3], rows[3:], strict=True):
        assert table.where == both.where
        assert 0 < both.worst_sigma_mm < tool + table.worst_sigma_mm
    assert at_workpiece(made.session, {"stage": "camera"}) == []


def test_how_far_the_flange_was_turned(solved: tuple[Session, dict[str, Any]]) -> None:
    session, result = solved
    turned = turned_deg(session, result)
    assert list(turned) == [capture.id for capture in session.captures]
    # The simulated cell begins with pure translations, up to the robot's 0.01°, and then turns by up to 0.6 rad.
    assert all(angle < 0.1 for angle in list(turned.values())[:4])
    assert all(1 < angle < 61 for angle in list(turned.values())[4:])
    assert turned_deg(session, {"stage": "camera"}) == {}


def test_a_result_beside_itself_differs_in_nothing(solved: tuple[Session, dict[str, Any]]) -> None:
    session, result = solved
    one = Compared("s", result, session, {})
    same = compare_results(one, one)
    assert same.changes == []
    assert same.shared == sum(row["used"] for row in result["residuals"])
    (frame,) = same.frames
    assert (frame.distance, frame.chance, frame.at_workpiece_mm) == (0.0, 1.0, 0.0)
    assert frame.degrees_of_freedom == 6
    assert frame.at_workpiece_sigma_mm > 0
    assert all(row.left == row.right for row in same.residuals)
    assert all(figure.left == figure.right for figure in same.figures)


def test_two_cells_alike_differ_as_their_covariance_says() -> None:
    """Independent calibrations of one cell: the squared distance is chi-squared with six degrees of freedom."""
    rng = np.random.default_rng(8)
    basis = rng.normal(size=(6, 6)) * np.array([[1e-4] * 3 + [0.05] * 3]).T
    covariance = basis @ basis.T
    frame = RigidTransform.of([0.3, -0.2, 1.0], [35.0, -120.0, 140.0], "tool0", "laser")
    point = np.array([5.0, 0.0, 190.0])
    rows = []
    for _ in range(400):
        left, right = (frame.perturbed(rng.multivariate_normal(np.zeros(6), covariance)) for _ in range(2))
        rows.append(frame_difference("tool0_from_laser", (left, right), 2 * covariance, point))
    squared = np.mean([row.distance**2 for row in rows])
    assert squared == pytest.approx(6, abs=4 * np.sqrt(12 / 400))
    assert np.mean([row.chance < 0.05 for row in rows]) == pytest.approx(0.05, abs=0.045)
    ratios = np.array([[axis.sigmas for axis in row.axes] for row in rows], dtype=float)
    assert np.allclose(ratios.std(axis=0), 1, atol=0.15)


def test_a_direction_without_variance_does_not_count() -> None:
    covariance = np.diag([1e-8, 1e-8, 0.0, 1.0, 1.0, 1.0])
    left = RigidTransform.identity("base", "turntable")
    right = left.perturbed([1e-4, 0, 0.5, 0, 0, 0])
    found = frame_difference("base_from_turntable", (left, right), covariance, np.zeros(3))
    assert found.degrees_of_freedom == 5
    assert found.axes[2].sigmas is None


def test_what_was_changed_between_two_solves() -> None:
    record = {
        "format": "scancell-session/1",
        "cell": {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0},
        "captures": [
            {"id": name, "step": "tcp", "kind": "profile", "files": [f"captures/{name}.csv"], "pose": [0.0] * 6}
            for name in ("p01", "p02", "p03", "p04")
        ],
    }
    left = parse_session(record)
    captures = [dict(c) for c in record["captures"]]
    captures[0]["excluded"] = True
    captures[1]["pose"] = [1.0, 0, 0, 0, 0, 0]
    captures[3] = {**captures[3], "id": "p05"}
    right = parse_session({**record, "cell": {**record["cell"], "sphere_diameter_mm": 40.1}, "captures": captures})
    files = ({"captures/p03.csv": "a" * 64}, {"captures/p03.csv": "b" * 64})
    found = [(change.kind, change.what) for change in changes(left, right, files)]
    assert found == [
        ("cell", "sphere_diameter_mm"),
        ("left-out", "p01"),
        ("changed", "p02 pose"),
        ("file", "p03 captures/p03.csv"),
        ("removed", "p04"),
        ("added", "p05"),
    ]
    assert changes(right, left)[1].kind == "taken-back"
    assert changes(left, left) == []


def test_numbers_that_are_none_are_refused(solved: tuple[Session, dict[str, Any]]) -> None:
    session, result = solved
    with pytest.raises(InputError, match="covariance"):
        at_workpiece(session, {**result, "covariance": [[1.0]]})
    one = Compared("s", {**result, "covariance": np.full((6, 6), 1e300).tolist()}, session)
    with pytest.raises(InputError, match="numbers that cannot be one"):
        compare_results(one, one)


def test_directions_that_err_together_count_once() -> None:
    covariance = np.diag([1e-8, 1e-8, 1e-8, 4.0, 4.0, 1.0])
    covariance[3, 4] = covariance[4, 3] = 4.0
    left = RigidTransform.identity("base", "turntable")
    right = left.perturbed([0, 0, 0, 2.0, 2.0, 0])
    found = frame_difference("base_from_turntable", (left, right), covariance, np.zeros(3))
    assert found.degrees_of_freedom == 5
    assert found.distance == pytest.approx(1.0)
