"""ChArUco boards and grids of circles on rendered frames: where they are found, against the truth."""

import cv2
import numpy as np
import pytest

from calib_core.optics.board import BoardView, find_board
from calib_core.optics.board_circles import _is_grid
from calib_core.records import Board
from calib_core.records.camera_result import CameraResult
from calib_core.simulation import simulate
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import BoardSurface
from calib_core.simulation.frames import Exposure, light, render, sense
from calib_core.simulation.motion import pose, turn
from calib_core.stages.pipeline import solve_stage

CAMERA = SimulatedCamera()
TURNS = [[0.3, -0.2, 0.1], [-0.4, 0.3, 0.5], [0.0, 0.0, 0.02]]
CHARUCO = BoardSurface(np.eye(4), 8, 6, 10.0, "charuco")
CIRCLES = BoardSurface(np.eye(4), 9, 6, 9.0, "circles")
SHIFTED = BoardSurface(np.eye(4), 4, 11, 7.0, "asymmetric-circles")


def seen(surface: BoardSurface, rotation: list[float]) -> tuple[BoardView, np.ndarray]:
    """The board that a frame shows, and how far off the truth its points are, px."""
    middle = surface.points_on_board_mm().mean(axis=0)
    placed = pose(turn(rotation), np.array([0, 0, 250.0]) - turn(rotation) @ middle)
    board = BoardSurface(placed, surface.columns, surface.rows, surface.pitch_mm, surface.kind)
    image = render(CAMERA, [board], None, Exposure(ambient=190.0, hot_pixels=80), np.random.default_rng(4))
    of_charuco = {"marker_mm": board.marker_mm, "dictionary": board.dictionary} if board.kind == "charuco" else {}
    record = {"kind": board.kind, "columns": board.columns, "rows": board.rows, "pitch_mm": board.pitch_mm}
    view = find_board(image, Board.model_validate(record | of_charuco))
    truth = CAMERA.pixels(board.points_on_board_mm() @ placed[:3, :3].T + placed[:3, 3])
    return view, view.points_px - truth[view.ids]


@pytest.mark.parametrize("rotation", TURNS)
def test_corners_between_markers_are_fitted_to_the_grey_values(rotation: list[float]) -> None:
    view, error = seen(CHARUCO, rotation)
    assert len(view.ids) == 35
    # An edge's grey values tell it to 0.005 px here; between the markers there is room for four pixels of it.
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert np.abs(error.mean(axis=0)).max() < 0.004


@pytest.mark.parametrize("surface", [CIRCLES, SHIFTED], ids=["circles", "asymmetric"])
@pytest.mark.parametrize("rotation", TURNS)
def test_circles_are_told_by_their_own_centres_not_those_of_their_ellipses(
    surface: BoardSurface, rotation: list[float]
) -> None:
    view, error = seen(surface, rotation)
    assert len(view.ids) == surface.columns * surface.rows
    # The ellipses' middles are off by 0.02 to 0.07 px at the first two tilts, all alike.
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert np.abs(error.mean(axis=0)).max() < 0.004


def test_points_are_a_grid_where_some_view_of_the_flat_board_has_them() -> None:
    """What OpenCV takes for a grid is believed only where a homography brings it about."""
    grey = np.zeros((480, 640), np.uint8)
    places = CIRCLES.points_on_board_mm()
    view = np.array([[5.0, 0.8, 120.0], [-0.4, 4.5, 90.0], [2e-3, 1e-3, 1.0]])
    shown = np.column_stack([places[:, :2], np.ones(len(places))]) @ view.T
    points = shown[:, :2] / shown[:, 2:]
    assert _is_grid(points, grey, places)
    wavy = points + np.random.default_rng(2).normal(0, 0.5, points.shape)
    assert _is_grid(wavy, grey, places)
    assert not _is_grid(np.random.default_rng(1).permutation(points), grey, places)
    assert not _is_grid(points + 300.0, grey, places)
    assert not _is_grid(points / 12, grey, places)


@pytest.mark.parametrize(("kind", "worst_px"), [("across", 0.02), ("shadow", 0.02)])
def test_circles_under_uneven_light_are_where_they_are(kind: str, worst_px: float) -> None:
    """Light that falls to a third across the image, or to a half within 25 px: OpenCV is 0.05 px off."""
    rotation = turn(TURNS[0])
    middle = CIRCLES.points_on_board_mm().mean(axis=0)
    board = BoardSurface(pose(rotation, np.array([0, 0, 250.0]) - rotation @ middle), 9, 6, 9.0, "circles")
    exposure = Exposure(ambient=190.0, hot_pixels=80)
    even = light(CAMERA, [board], None, exposure, np.random.default_rng(4))
    across = np.linspace(0.0, 1.0, even.shape[1])
    lamp = 1 - 0.66 * across if kind == "across" else 0.5 + 0.5 / (1 + np.exp((across - 0.5) * 50))
    image = sense(even * lamp, exposure, np.random.default_rng(4))
    record = {"kind": "circles", "columns": 9, "rows": 6, "pitch_mm": 9.0}
    view = find_board(image, Board.model_validate(record))
    truth = CAMERA.pixels(board.points_on_board_mm() @ rotation.T + board.camera_from_board[:3, 3])
    error = view.points_px - truth[view.ids]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < worst_px
    found, centers = cv2.findCirclesGrid(image, (9, 6), flags=cv2.CALIB_CB_SYMMETRIC_GRID)
    assert found
    peer = np.asarray(centers, dtype=float).reshape(-1, 2)
    off = min(np.sqrt(np.mean(np.sum((p - truth) ** 2, axis=1))) for p in (peer, peer[::-1]))
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < off


@pytest.mark.thorough
@pytest.mark.parametrize("scenario", ["camera-charuco", "camera-circles"])
def test_the_camera_found_from_other_boards_errs_as_it_states(scenario: str) -> None:
    simulated = simulate(scenario, 3)
    result = solve_stage(simulated.session, "camera", simulated.files.__getitem__)
    assert isinstance(result, CameraResult)
    assert result.reprojection_rms_px < 0.015
    assert all(row.used for row in result.residuals)
    truth = np.array(simulated.truth["camera"]["camera_matrix"])
    found = np.array(result.camera_matrix)
    sigma = dict(zip(result.parameters, np.sqrt(np.diag(result.covariance)), strict=True))
    for name, place in (("fx", (0, 0)), ("fy", (1, 1)), ("cx", (0, 2)), ("cy", (1, 2))):
        assert abs(found[place] - truth[place]) < 4 * sigma[name], name
    assert sigma["fx"] < 0.2


@pytest.mark.parametrize("legacy", [False, True])
def test_a_charuco_board_of_either_pattern_is_found(legacy: bool) -> None:
    """With an even number of rows OpenCV's boards of before 4.6 begin with another colour."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    printed = cv2.aruco.CharucoBoard((8, 6), 10.0, 7.5, dictionary)
    printed.setLegacyPattern(legacy)
    image = printed.generateImage((800, 600), marginSize=60)
    record = {"kind": "charuco", "columns": 8, "rows": 6, "pitch_mm": 10.0, "marker_mm": 7.5}
    view = find_board(image, Board.model_validate(record | {"dictionary": "DICT_5X5_100"}))
    np.testing.assert_array_equal(np.sort(view.ids), np.arange(35))
    scale = np.linalg.norm(view.points_px[1] - view.points_px[0]) / 10.0
    apart_px = np.linalg.norm(view.points_px[:, None] - view.points_px[None], axis=2)
    apart_mm = np.linalg.norm(view.points_in_board_mm[:, None] - view.points_in_board_mm[None], axis=2)
    np.testing.assert_allclose(apart_px, scale * apart_mm, atol=0.6)
