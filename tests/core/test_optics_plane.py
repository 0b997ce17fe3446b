"""The plane of light: exact without noise, with true covariance, robust, and honest where it is not determined."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.frames import RigidTransform
from calib_core.optics import laser_plane_joint
from calib_core.optics.adjust import Adjusted, Adjustment, State
from calib_core.optics.board import BoardView
from calib_core.optics.board_shape import BoardShape
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_layout import parameter_places
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane import BoardLine, fit_plane, plane_findings, rotation_sigma_deg
from calib_core.optics.laser_plane_borne_out import Boards
from calib_core.optics.laser_plane_joint import CameraUncertainty
from calib_core.optics.laser_plane_solve import PlaneSolution, PlaneView, board_poses, solve_plane
from calib_core.optics.stripe import StripeCenters
from calib_core.stages.laser_plane.solve import bend_of

MATRIX = np.array([[900.0, 0, 320.0], [0, 905.0, 240.0], [0, 0, 1]])
CAMERA = CameraModel.from_names(MATRIX, {"k1": -0.12, "k2": 0.08, "p1": 4e-4}, (640, 480))
NORMAL, DISTANCE = np.array([0.0, np.cos(0.5), np.sin(0.5)]), 120.0
GRID = np.column_stack([np.tile(np.arange(9), 6) * 9.0, np.repeat(np.arange(6), 9) * 9.0, np.zeros(54)])


def view(rng: np.random.Generator, corner_px: float, stripe_px: float, depth_mm: float, name: str) -> PlaneView:
    """A board near the plane of light, its line cut exactly, both with noise."""
    rotation = RigidTransform.of(rng.uniform(-0.35, 0.35, 3), np.zeros(3), "camera", "board").rotation
    offset = np.array([*rng.uniform(-0.03, 0.03, 2) * depth_mm, depth_mm])
    pose = RigidTransform.of(rotation, offset - rotation @ GRID.mean(axis=0), "camera", "board")
    corners = CAMERA.project(pose.apply(GRID)) + rng.normal(0, corner_px, (54, 2))
    n, d = pose.rotation.T @ NORMAL, DISTANCE - NORMAL @ pose.translation_mm
    x = np.linspace(0, 72, 160)
    line = np.column_stack([x, (d - n[0] * x) / n[1], np.zeros_like(x)])
    pixels = CAMERA.project(pose.apply(line))
    pixels[:, 1] += rng.normal(0, stripe_px, len(x))
    sigma = np.full(len(x), stripe_px)
    stripe = StripeCenters(pixels[:, 0], pixels[:, 1], sigma, sigma * 0 + 100, "columns", 2.0, 1.0)
    return PlaneView(name, BoardView(corners, GRID, np.arange(54), (640, 480), corner_px), stripe)


def views(seed: int, count: int = 8, corner_px: float = 0.05, stripe_px: float = 0.05) -> list[PlaneView]:
    rng = np.random.default_rng(seed)
    depths = np.linspace(190, 300, count)
    return [view(rng, corner_px, stripe_px, depth, f"l{k}") for k, depth in enumerate(depths)]


def test_without_noise_the_plane_is_exact() -> None:
    found = solve_plane(CAMERA, views(1, corner_px=1e-7, stripe_px=1e-7))
    np.testing.assert_allclose(found.normal, NORMAL, atol=1e-7)
    assert found.distance_mm == pytest.approx(DISTANCE, abs=1e-4)
    assert found.rms_mm < 1e-5


@pytest.mark.thorough
def test_the_stated_covariance_is_true() -> None:
    values = []
    for seed in range(24):
        found = solve_plane(CAMERA, views(seed))
        error = np.array([*(found.normal - NORMAL), found.distance_mm - DISTANCE])
        values.append(error @ np.linalg.pinv(found.covariance, rcond=1e-10, hermitian=True) @ error)
    # Mean of 24 χ² of 3 degrees: 3 ± 1.96 √(2·3/24) = ±0.98; sigmas from 108 residuals widen it a little.
    assert 2.0 < np.mean(values) < 4.1


def test_an_uncertain_camera_makes_the_plane_less_certain() -> None:
    exact = solve_plane(CAMERA, views(3))
    uncertain = solve_plane(
        CAMERA, views(3), CameraUncertainty(np.array([0, 1, 2, 3]), np.diag([1.0, 1.0, 1.0, 1.0]))
    )
    np.testing.assert_array_equal(exact.normal, uncertain.normal)
    assert rotation_sigma_deg(uncertain.covariance) > 1.2 * rotation_sigma_deg(exact.covariance)


@pytest.mark.thorough
def test_camera_boards_and_plane_refined_together_are_true_and_nearer_than_apart() -> None:
    planes, focal, apart, together = [], [], [], []
    for seed in range(16):
        seen = views(seed)
        boards = [v.board for v in seen]
        solved = calibrate_camera(boards, (640, 480), CameraOptions(model="plain"))
        known = CameraUncertainty(parameter_places(solved.parameters), solved.covariance)
        first = solve_plane(solved.camera, seen, known)
        found = solve_plane(solved.camera, seen, replace(known, boards=()))
        error = np.array([*(found.normal - NORMAL), found.distance_mm - DISTANCE])
        planes.append(error @ np.linalg.pinv(found.covariance, rcond=1e-10, hermitian=True) @ error)
        deviation = np.sqrt(found.joint_covariance[0, 0])
        focal.append((found.camera.camera_matrix[0, 0] - MATRIX[0, 0]) / deviation)
        apart.append(first.distance_mm - DISTANCE)
        together.append(found.distance_mm - DISTANCE)
    # Mean of 16 χ² of 3 degrees: 3 ± 3.3 √(2·3/16) = ±2.02; a mean of 16 unit normals: ± 3.3 / 4.
    assert 0.98 < np.mean(planes) < 5.02
    assert abs(np.mean(focal)) < 0.82  # a stripe's noise, squared, once drew the focal length by this and more
    assert np.mean(np.square(together)) < np.mean(np.square(apart))


def test_one_moved_board_is_found_out() -> None:
    seen = views(4)
    spoiled = seen[2]
    moved = StripeCenters(
        spoiled.stripe.column_px, spoiled.stripe.row_px + 15, spoiled.stripe.sigma_px, spoiled.stripe.amplitude,
        "columns", 2.0, 1.0,
    )  # fmt: skip
    seen[2] = PlaneView(spoiled.name, spoiled.board, moved)
    found = solve_plane(CAMERA, seen)
    reasons = {v.name: v.left_out for v in found.views}
    assert reasons.pop("l2") == "off-plane"
    assert set(reasons.values()) == {None}
    assert np.rad2deg(np.arccos(found.normal @ NORMAL)) < 0.1


def test_a_reflection_beside_the_line_does_no_harm() -> None:
    seen = views(5)
    place = whose_line_is_amid_the_board(seen)
    chosen = seen[place]
    row = chosen.stripe.row_px.copy()
    row[20:50] -= 40
    seen[place] = with_rows(chosen, row)
    found = solve_plane(CAMERA, seen)
    assert found.views[place].left_out is None
    assert found.views[place].points <= 130
    assert np.rad2deg(np.arccos(found.normal @ NORMAL)) < 0.1


def whose_line_is_amid_the_board(seen: list[PlaneView]) -> int:
    off = [abs(np.mean(v.stripe.row_px) - np.mean(v.board.points_px[:, 1])) for v in seen]
    return int(np.argmin(off))


def with_rows(view: PlaneView, row_px: np.ndarray) -> PlaneView:
    stripe = view.stripe
    moved = StripeCenters(stripe.column_px, row_px, stripe.sigma_px, stripe.amplitude, "columns", 2.0, 1.0)
    return PlaneView(view.name, view.board, moved)


def test_centres_that_form_no_line_are_no_laser() -> None:
    """Where the laser is off, the stripe's finder still meets bright patterns: scattered, or few in a row."""
    rng, seen = np.random.default_rng(2), views(6)
    place = whose_line_is_amid_the_board(seen)
    chosen = seen[place]
    top, bottom = chosen.board.points_px[:, 1].min(), chosen.board.points_px[:, 1].max()
    row_px, count = chosen.stripe.row_px, len(chosen.stripe.row_px)
    middle = np.linspace(-1, 1, count)
    for rows, reason in (
        (rng.uniform(top, bottom, count), "no-line"),
        (np.where(rng.random(count) < 0.25, row_px + 20 + 15 * middle, 5.0), "no-line"),
        (
            np.where(rng.random(count) < 0.25, row_px, 5.0),
            None,
        ),  # in the others' plane: a line of which little is seen
    ):
        found = solve_plane(CAMERA, [*seen[:place], with_rows(chosen, rows), *seen[place + 1 :]])
        assert found.views[place].left_out == reason
        assert np.rad2deg(np.arccos(found.normal @ NORMAL)) < 0.1


@pytest.mark.thorough
def test_stripes_that_draw_the_camera_too_far_leave_it_where_its_boards_have_it() -> None:
    seen = views(7)
    boards = [v.board for v in seen]
    solved = calibrate_camera(boards, (640, 480), CameraOptions(model="plain"))
    known = CameraUncertainty(parameter_places(solved.parameters), solved.covariance, ())
    assert not solve_plane(solved.camera, seen, known).camera_held
    # Boards that are told to know the camera thirty times better than they do.
    certain = replace(known, covariance=known.covariance / 900)
    found = solve_plane(solved.camera, seen, certain)
    assert found.camera_held
    np.testing.assert_array_equal(found.camera.camera_matrix, solved.camera.camera_matrix)
    alone = solve_plane(solved.camera, seen, replace(certain, boards=None))
    np.testing.assert_allclose(found.joint_covariance, alone.joint_covariance)


def bent_stripes(seed: int) -> tuple[CameraModel, PlaneSolution, PlaneSolution]:
    """Return a camera, its plane by true stripes, and by stripes bent as by a lens of twice the distortion.

    The camera's boards say so little of it that three sigmas are far.
    """
    seen = views(seed)
    solved = calibrate_camera([v.board for v in seen], (640, 480), CameraOptions(model="plain"))
    known = CameraUncertainty(parameter_places(solved.parameters), 400 * solved.covariance, ())
    other = CameraModel.from_names(MATRIX, {"k1": -0.24, "k2": 0.08, "p1": 4e-4}, (640, 480))
    bent = [seen_through(other, v) for v in seen]
    return solved.camera, solve_plane(solved.camera, seen, known), solve_plane(solved.camera, bent, known)


@pytest.mark.parametrize("seed", [7, 11])
def test_stripes_that_make_other_boards_corners_worse_leave_the_camera_as_it_is(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def as_stated(problem: Adjustment, state: State) -> tuple[Adjustment, Adjusted, float]:
        return problem, problem.solve(state), 1.0

    def as_agreeing(boards: Boards) -> tuple[Boards, float]:
        return boards, 0.0

    # Bent lines weigh less as soon as they are seen to be: here they keep the weight that their centres state.
    monkeypatch.setattr(laser_plane_joint, "_with_stripe_noise", as_stated)
    monkeypatch.setattr(laser_plane_joint, "borne_out", as_agreeing)
    camera, true, found = bent_stripes(seed)
    assert true.camera_held is None
    assert found.camera_held is not None
    assert found.camera_held.values["course"] == "worse"
    np.testing.assert_array_equal(found.camera.camera_matrix, camera.camera_matrix)


@pytest.mark.parametrize("seed", [7, 10, 11])
def test_bent_stripes_that_corners_cannot_tell_do_no_harm_that_counts(seed: int) -> None:
    """A line that is bent weighs as little as it scatters: what it does is less than held-out corners can show."""
    camera, true, found = bent_stripes(seed)
    before = projection_error_px(camera)
    assert projection_error_px(true.camera) < before  # true ones help
    assert projection_error_px(found.camera) < before + 0.01  # of corners that err by 0.05


def projection_error_px(camera: CameraModel) -> float:
    """Return how far off exact corners of other boards are, each board's pose fitted to them, RMS."""
    boards = [v.board for v in views(101, 6, 1e-9, 1e-9)]
    off = [
        camera.project(pose.apply(GRID)) - board.points_px
        for board, pose in zip(boards, board_poses(camera, boards)[0], strict=True)
    ]
    return float(np.sqrt(np.mean(np.square(off)) * 2))


def seen_through(other: CameraModel, view: PlaneView) -> PlaneView:
    rays = np.column_stack([CAMERA.undistort(view.stripe.pixels), np.ones(len(view.stripe.pixels))])
    column, row = other.project(rays).T
    stripe = StripeCenters(column, row, view.stripe.sigma_px, view.stripe.amplitude, "columns", 2.0, 1.0)
    return PlaneView(view.name, view.board, stripe)


def test_figures_of_the_boards_are_those_of_the_total() -> None:
    found = solve_plane(CAMERA, views(8))
    squares = sum(view.points * view.line_rms_mm**2 for view in found.views if view.left_out is None)
    count = sum(view.points for view in found.views if view.left_out is None)
    assert np.sqrt(squares / count) == pytest.approx(found.rms_mm, rel=1e-9)


def test_one_board_does_not_make_a_plane() -> None:
    with pytest.raises(MotionError, match="at least two boards"):
        solve_plane(CAMERA, views(1)[:1])


def line(offset: np.ndarray, name: str, angle: float = 0.0) -> BoardLine:
    t = np.linspace(-40, 40, 200)
    points = offset + np.outer(t, [np.cos(angle), np.sin(angle) * NORMAL[2], -np.sin(angle) * NORMAL[1]])
    return BoardLine(name, points, np.full(200, 0.02))


def on_plane(z: float) -> np.ndarray:
    return np.array([0.0, (DISTANCE - NORMAL[2] * z) / NORMAL[1], z])


def test_lines_that_are_one_and_the_same_leave_the_plane_undetermined() -> None:
    with pytest.raises(MotionError, match="of one straight line"):
        fit_plane([line(on_plane(250.0), "a"), line(on_plane(250.1), "b"), line(on_plane(250.2), "c")])


def test_lines_close_together_are_warned_of_and_spread_ones_are_not() -> None:
    near = [line(on_plane(z), str(z)) for z in (250, 251, 252, 253)]
    assert "close to each other and nearly parallel" in plane_findings(fit_plane(near), near, 0.01)[0].text
    spread = [line(on_plane(z), str(z)) for z in (200, 230, 260, 300)]
    assert plane_findings(fit_plane(spread), spread, 0.01) == []
    assert "±1.00°" in plane_findings(fit_plane(spread), spread, 0.5)[0].text


def bent_views(seed: int, bend_mm: float) -> list[PlaneView]:
    """Boards whose middle of the rows stands off their ends, with the light where it meets that sheet."""
    rng, made = np.random.default_rng(seed), []
    shape = BoardShape(np.array([-bend_mm, 0, 0, 0, 0, 0, 0]), np.array([GRID[:, :2].min(0), GRID[:, :2].max(0)]))
    for number, depth in enumerate(np.linspace(190, 300, 8)):
        rotation = RigidTransform.of(rng.uniform(-0.35, 0.35, 3), np.zeros(3), "camera", "board").rotation
        offset = np.array([*rng.uniform(-0.03, 0.03, 2) * depth, depth])
        pose = RigidTransform.of(rotation, offset - rotation @ GRID.mean(axis=0), "camera", "board")
        lifted = GRID + np.outer(shape.heights_mm(GRID), [0, 0, 1])
        corners = CAMERA.project(pose.apply(lifted)) + rng.normal(0, 0.02, (54, 2))
        n, d = pose.rotation.T @ NORMAL, DISTANCE - NORMAL @ pose.translation_mm
        line = np.column_stack([np.linspace(0, 72, 160), np.zeros((160, 2))])
        for _ in range(30):
            line[:, 2] = shape.heights_mm(line)
            line[:, 1] = (d - n[0] * line[:, 0] - n[2] * line[:, 2]) / n[1]
        pixels = CAMERA.project(pose.apply(line))
        sigma = np.full(160, 0.05)
        pixels[:, 1] += rng.normal(0, sigma)
        stripe = StripeCenters(pixels[:, 0], pixels[:, 1], sigma, sigma * 0 + 100, "columns", 2.0, 1.0)
        made.append(PlaneView(f"l{number}", BoardView(corners, GRID, np.arange(54), (640, 480), 0.02), stripe))
    return made


def test_the_bend_of_boards_before_a_known_camera_is_solved_with_the_plane() -> None:
    """Of a sheet bent by 1 mm the plane is as well known as stated; a flat one, or one told flat, stays flat."""
    seen = bent_views(1, 1.0)
    boards = [v.board for v in seen]
    known = bend_of(CAMERA, boards, None)
    assert known is not None
    assert known.shape is not None
    assert known.shape.bend_mm(GRID) == pytest.approx(1.0, abs=0.02)
    found, flat = solve_plane(CAMERA, seen, known), solve_plane(CAMERA, seen)
    errors = [np.array([*(one.normal - NORMAL), one.distance_mm - DISTANCE]) for one in (found, flat)]
    assert np.linalg.norm(errors[0][:3]) < 0.1 * np.linalg.norm(errors[1][:3])
    assert abs(errors[0][3]) < 0.1 * abs(errors[1][3])
    nees = errors[0] @ np.linalg.pinv(found.covariance, rcond=1e-10, hermitian=True) @ errors[0]
    assert nees < 14.2  # χ² of 3 degrees is above that once in 400
    assert found.camera_held is None
    assert bend_of(CAMERA, boards, flat=True) is None
    assert bend_of(CAMERA, [v.board for v in bent_views(2, 0.0)], None) is None
    assert bend_of(CAMERA, boards[:5], None) is None
